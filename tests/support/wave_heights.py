"""Height and slope of waves relative to their object, measured independently of the package."""

import functools

import igl
import numpy as np
from scipy.ndimage import median_filter

from ripple_sim.solver import Atlas, WaveSolver


class WaveHeights:
    """Greatest height of the waves over half the local thickness, and greatest steep share.

    `highest` and `steepest` are the greatest values that calls of `look` have seen.
    """

    def __init__(self, atlas: Atlas, steep: float) -> None:
        self._atlas = atlas
        self._steep = steep
        self._size = float(np.ptp(atlas.mesh.V, axis=0).max())
        self.highest = self.steepest = 0.0

    def look(self, waves: WaveSolver) -> None:
        h = waves.height.astype(np.float64)
        if np.abs(h).max() < 1e-3 * self._size:
            return
        self.highest = max(self.highest, float((np.abs(h.ravel()) / self._radius).max()))
        duals, areas = self._quads
        rises = np.stack([h[:, :-1, 1:] - h[:, :-1, :-1], h[:, 1:, :-1] - h[:, :-1, :-1]], axis=-1)
        gradient = np.linalg.norm(np.einsum("cijxk,cijk->cijx", duals, rises), axis=-1)
        self.steepest = max(self.steepest, float(areas[gradient > self._steep].sum() / areas.sum()))

    @functools.cached_property
    def _radius(self) -> np.ndarray:
        """Half the distance to the other side [m], [C, n, n], within limits by the size."""
        atlas = self._atlas
        tree = igl.AABB()
        V = atlas.mesh.V / self._size
        F = atlas.mesh.F
        tree.init(V, F)
        corners = V[F[atlas.triangles.ravel()]]
        across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 1] - corners[:, 0])
        ways = []
        # a needle's own normal may point anywhere, and so may a texel's in a sharp crease
        for inward in (
            -atlas.normals.reshape(-1, 3),
            across / np.linalg.norm(across, axis=1, keepdims=True),
        ):
            start = atlas.positions.reshape(-1, 3) / self._size + 1e-3 * inward
            triangles, distance, _ = tree.intersect_ray_first(V, F, start, inward)
            ways.append(np.where(triangles >= 0, np.clip(distance + 1e-3, 0.02, 1.0), 1.0))
        radius = self._size / 2 * np.maximum(*ways).reshape(atlas.areas.shape)
        return median_filter(radius, (1, 3, 3)).ravel()

    @functools.cached_property
    def _quads(self) -> tuple[np.ndarray, np.ndarray]:
        """Dual vectors of the quads' sides, [C, n - 1, n - 1, 3, 2], and areas."""
        P = self._atlas.positions
        sides = np.stack([P[:, :-1, 1:] - P[:, :-1, :-1], P[:, 1:, :-1] - P[:, :-1, :-1]], axis=-1)
        areas = np.linalg.norm(np.cross(sides[..., 0], sides[..., 1]), axis=-1)
        return np.linalg.pinv(np.swapaxes(sides, -1, -2)), areas
