"""Ambient occlusion and thickness of a surface that moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ripple_sim.render.visuals.ambient_occlusion import bounding_radius, cast, frames_about
from ripple_sim.render.visuals.corners import smooth_normals

from .coarse_mesh import coarse_mesh
from .moving import MovingVertices

_SAMPLES = 1_000  # vertices that cast rays, at most
_RAYS = 32_000  # a frame, about
_NEAR = 6  # samples about a point


class MovingOcclusion:
    """Adds to what is baked at rest how it changes.

    Rays find the change, from the vertices of a coarse mesh that moves along, against that mesh, at rest and in each
    frame: what is coarse about it is then in both. The rays turn with the surface, so that a rigid motion changes
    nothing and noise does not crawl.

    Parameters
    ----------
    V : float64 [k, 3]
        Vertices of the mesh at rest [m].
    F : int64 [m, 3]
    points, directions : float64 [n, 3]
        Of the drawn surface at rest, and its smooth normals.
    baked : float64 [n, 3]
        Ambient visibility, thickness and inner ambient visibility of the points, see `Baked`.
    """

    def __init__(self, V: NDArray, F: NDArray, points: NDArray, directions: NDArray, baked: NDArray) -> None:
        count, normals = min(_SAMPLES, len(V)), smooth_normals(V, F)
        spacing = float(np.sqrt(_area(V, F) / count))
        apart = 2 * spacing * normals  # so that the two sides of a thin body are far from each other
        mesh = coarse_mesh(F, np.hstack([V, apart]), count)
        near = np.hstack([V, apart])[mesh.vertices], np.hstack([points, 2 * spacing * directions])
        self._baked, (self._near, self._weights) = baked, _nearest(*near)
        self._vertices, self._F, self._radius = mesh.vertices, mesh.F, bounding_radius(V)
        # triangles of a coarse mesh may lie slightly over its vertices
        self._start = 0.3 * spacing if count < len(V) else 0.0
        self._count = int(np.clip(_RAYS // (2 * count), 16, 64))
        at_rest, normals = self._of(V), normals[mesh.vertices]
        self._frames = MovingVertices(at_rest, mesh.F, at_rest, frames_about(normals)[:, 1], normals)
        self._rest = self._measured(V)

    def __call__(self, V: NDArray[np.float64]) -> NDArray[np.float32]:
        """What `baked` is for vertices [k, 3] [m]."""
        change = self._measured(V) - self._rest
        baked = self._baked + np.einsum("ij,ijk->ik", self._weights, change[self._near])
        return np.clip(baked, 0.0, [1.0, 4.0, 1.0]).astype(np.float32)

    def _of(self, V: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vertices of the coarse mesh, about their mean: rays are in single precision."""
        some = V[self._vertices]
        return some - some.mean(axis=0)

    def _measured(self, V: NDArray[np.float64]) -> NDArray[np.float64]:
        V = self._of(V)
        moved = self._frames(V)
        frames = frames_about(moved.normals, moved.directions)
        return np.stack(cast(V, self._F, frames, self._count, self._radius, self._start), axis=1)


def _area(V: NDArray, F: NDArray) -> float:
    return float(np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1).sum() / 2)


def _nearest(samples: NDArray, points: NDArray) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The samples nearest to each point, [n, k], and weights, of which that of the farthest is 0: no point jumps."""
    distance, near = cKDTree(samples).query(points, min(_NEAR + 1, len(samples)))
    reach = np.maximum(distance[:, -1:], 1e-300)
    weights = (1 - distance / reach) ** 2 + 1e-12
    return near, weights / weights.sum(axis=1, keepdims=True)
