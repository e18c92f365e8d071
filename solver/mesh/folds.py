"""Triangles of a moving mesh that are turned over or crushed, and its vertices' normals, as quickly as can be."""

from __future__ import annotations

import numpy as np

from ..kernel import Bools, Floats, Ints, kernel
from .topology import sides_of

# A triangle with less than this share of its area at rest counts as crushed.
_LEAST = 1e-3

# Two triangles lie back to back where the cosine between their normals is less than minus this.
_BACK = 0.95


class Folds:
    """Looks for triangles that are folded as they were not at rest.

    Parameters
    ----------
    V : float64 [n, 3]
        Vertices at rest [m].
    F : int64 [m, 3]
    """

    def __init__(self, V: Floats, F: Ints) -> None:
        self.F = F
        beside = np.full(F.size, -1)
        pairs = sides_of(F)[0]
        beside[pairs[:, 0]], beside[pairs[:, 1]] = pairs[:, 1] // 3, pairs[:, 0] // 3
        self._beside = beside.reshape(-1, 3)
        normals = _area_vectors(np.asarray(V, np.float64), F)
        self._least = _LEAST * np.linalg.norm(normals, axis=1)
        self._rest = _folded(normals, self._beside, self._least)

    def count(self, V: Floats) -> int:
        """How many triangles are folded back on one that they share a side with, or have next to no area."""
        return int((_folded(_area_vectors(V, self.F), self._beside, self._least) & ~self._rest).sum())

    def vertex_normals(self, V: Floats) -> Floats:
        """Unit normals [n, 3], weighted by the areas of the triangles."""
        return _vertex_normals(_area_vectors(V, self.F), self.F, len(V))


@kernel
def _area_vectors(V: Floats, F: Ints) -> Floats:
    """Normals of triangles, twice as long as their areas, [m, 3]."""
    vectors = np.empty((len(F), 3))
    for i in range(len(F)):
        a, b, c = F[i, 0], F[i, 1], F[i, 2]
        ux, uy, uz = V[b, 0] - V[a, 0], V[b, 1] - V[a, 1], V[b, 2] - V[a, 2]
        vx, vy, vz = V[c, 0] - V[a, 0], V[c, 1] - V[a, 1], V[c, 2] - V[a, 2]
        vectors[i, 0], vectors[i, 1], vectors[i, 2] = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return vectors


@kernel
def _folded(vectors: Floats, beside: Ints, least: Floats) -> Bools:
    """Whether triangles lie flat on one beside them [m, 3], back to back, or are smaller than the least [m]."""
    folded = np.zeros(len(vectors), np.bool_)
    for i in range(len(vectors)):
        x, y, z = vectors[i, 0], vectors[i, 1], vectors[i, 2]
        square = x * x + y * y + z * z
        folded[i] = np.sqrt(square) < least[i]
        for k in range(3):
            j = beside[i, k]
            if j >= 0:
                u, v, w = vectors[j, 0], vectors[j, 1], vectors[j, 2]
                along = x * u + y * v + z * w
                folded[i] |= along < 0 and along * along > _BACK**2 * square * (u * u + v * v + w * w)
    return folded


@kernel
def _vertex_normals(vectors: Floats, F: Ints, count: int) -> Floats:
    """Unit sum of the vectors [m, 3] of the triangles at each vertex; along z where there is none."""
    normals = np.zeros((count, 3))
    for i in range(len(F)):
        for k in range(3):
            for axis in range(3):
                normals[F[i, k], axis] += vectors[i, axis]
    for v in range(count):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        if length > 0:
            for axis in range(3):
                normals[v, axis] /= length
        else:
            normals[v, 2] = 1.0
    return normals
