"""The skin of a target: a fine triangle mesh whose points and normals follow the waves, changed in place."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.surfaces.charts import Charts
from ripple_sim.render.surfaces.moving_surface import MovingSurface
from ripple_sim.render.surfaces.vertices import COORDINATES, DIRECTION, NORMAL, POSITION, tessellated
from ripple_sim.render.visuals.corners import smooth_normals
from ripple_sim.solver import Atlas, HeightMap
from ripple_sim.solver.kernel import Floats32, Ints32, kernel

# Software OpenGL draws this many triangles 30 times a second beside the simulation, on two cores.
MAX_TRIANGLES = 24_000


class Skin:
    """A surface, tessellated to about its texels and displaced by their heights.

    Parameters
    ----------
    atlas : Atlas
    limit : bool
        Whether heights that are too large for the object are bent, see `DisplacementLimit`.

    Attributes
    ----------
    F : int64 [m, 3]
        Triangles, counter-clockwise from outside.
    points : float32 [n, 3]
        Displaced vertices in the frame of the mesh [m].
    normals : float32 [n, 3]
        Unit normals of the displaced surface; creases of the mesh stay sharp.
    height : float32 [n]
        [m].
    """

    def __init__(self, atlas: Atlas, limit: bool = True) -> None:
        mesh, charts = atlas.mesh, Charts.of(atlas)
        self.F, vertices, _ = tessellated(
            mesh,
            charts,
            smooth=smooth_normals(mesh.V, mesh.F),
            max_length=float(np.sqrt(atlas.areas.mean())),
            max_faces=MAX_TRIANGLES,
        )
        for columns in (DIRECTION, NORMAL):  # those of midpoints are means
            vertices[:, columns] /= np.linalg.norm(vertices[:, columns], axis=1, keepdims=True)
        rest, direction, normals = (
            np.ascontiguousarray(vertices[:, columns], dtype=np.float32) for columns in (POSITION, DIRECTION, NORMAL)
        )
        chart_points = charts.map.chart_points(vertices[:, COORDINATES], atlas.resolution)
        self._rest = _Rest(rest, direction, normals, *_bilinear(*chart_points, atlas.resolution))
        self._height_map = HeightMap.drawn(atlas, limit)
        self._moving = MovingSurface(atlas, rest, direction, normals)
        self.points, self.normals = rest.copy(), normals.copy()
        self.height = np.zeros(len(vertices), np.float32)

    def update(self, height: NDArray[np.float32], V: NDArray[np.float64] | None = None) -> None:
        """Follow a height field, float32 [C, n, n], and the vertices of the mesh, [vertex_count, 3], in metres."""
        height_map, rest = self._height_map(height), self._rest
        if V is not None:
            height_map, moved = self._moving(height_map, V)
            rest = rest._replace(points=moved.points, directions=moved.directions, normals=moved.normals)
        _displace(height_map.reshape(-1, 4), rest, self.points, self.normals, self.height)


def _bilinear(
    chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64], n: int
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Addresses in a height map [C (n + 2)^2] and weights of the four texels round each chart point, [k, 4] both."""
    # the height map has a halo around each chart
    row, column = np.clip(row + 1, 0, n + 1), np.clip(column + 1, 0, n + 1)
    r, c = np.minimum(row.astype(np.int64), n), np.minimum(column.astype(np.int64), n)
    s, t = row - r, column - c
    corner = (chart * (n + 2) + r) * (n + 2) + c
    texels = np.stack([corner, corner + 1, corner + n + 2, corner + n + 3], axis=1)
    weights = np.stack([(1 - s) * (1 - t), (1 - s) * t, s * (1 - t), s * t], axis=1)
    return texels.astype(np.int32), weights.astype(np.float32)


class _Rest(NamedTuple):
    """The undisplaced skin: points and outward directions and normals [n, 3], and where each point lies on the texels.

    `texels` and `weights` [n, 4] are addresses in a height map [C (n + 2)^2] and bilinear weights.
    """

    points: Floats32
    directions: Floats32
    normals: Floats32
    texels: Ints32
    weights: Floats32


@kernel
def _displace(height_map: Floats32, rest: _Rest, points: Floats32, normals: Floats32, height: Floats32) -> None:
    """Raise points by the height; a normal tips against the gradient, to first order in the height."""
    texels, weights, direction, rest_normals = rest.texels, rest.weights, rest.directions, rest.normals
    for i in range(len(texels)):
        gx = gy = gz = h = np.float32(0)
        for k in range(4):
            weight, texel = weights[i, k], texels[i, k]
            gx += weight * height_map[texel, 0]
            gy += weight * height_map[texel, 1]
            gz += weight * height_map[texel, 2]
            h += weight * height_map[texel, 3]
        height[i] = h
        for k in range(3):
            points[i, k] = rest.points[i, k] + h * direction[i, k]
        x, y, z = rest_normals[i, 0] - gx, rest_normals[i, 1] - gy, rest_normals[i, 2] - gz
        scale = 1 / np.sqrt(x * x + y * y + z * z)
        normals[i, 0], normals[i, 1], normals[i, 2] = x * scale, y * scale, z * scale
