"""Normals of vertices, which point away from every triangle round them where any direction does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_STEEP = 0.1  # cosine between a vertex's normal and a triangle's below which another direction is looked for
_STEPS = 300


def vertex_normals(V: NDArray[np.float64], F: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit normals weighted by corner angle, shape [n, 3] (Thuermer and Wuethrich 1998).

    At tips and knife edges that mean may point into a triangle. There the direction is taken that is nearest to the
    farthest of the triangles' normals (Aubry and Loehner 2008), if it is better.
    """
    normal = _unit(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]))
    corners, total = V[F], np.zeros_like(V)
    for k in range(3):
        a, b = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
        for axis in range(3):
            total[:, axis] += np.bincount(F[:, k], weights=angle * normal[:, axis], minlength=len(V))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    mean = np.where(length > 0, _unit(total), [0.0, 0.0, 1.0])
    vertex, triangle = F.ravel(), np.repeat(np.arange(len(F)), 3)
    steep = np.flatnonzero(_worst(mean, vertex, normal[triangle]) < _STEEP)
    if not len(steep):
        return mean
    chosen = np.isin(vertex, steep)
    vertex, beside = np.searchsorted(steep, vertex[chosen]), normal[triangle[chosen]]
    other = _middles(mean[steep], vertex, beside)
    better = _worst(other, vertex, beside) > _worst(mean[steep], vertex, beside)
    mean[steep[better]] = other[better]
    return mean


def _middles(start: NDArray[np.float64], vertex: NDArray[np.int64], beside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Middles [k, 3] of the smallest caps that hold the normals [c, 3] at vertices [c] (Badoiu and Clarkson 2003)."""
    middle = start.copy()
    for i in range(1, _STEPS):
        cosine = np.einsum("ij,ij->i", middle[vertex], beside)
        order = np.lexsort((cosine, vertex))
        farthest = order[np.searchsorted(vertex[order], np.arange(len(middle)))]
        middle += (beside[farthest] - middle) / (i + 1)
    return _unit(middle)


def _worst(normal: NDArray[np.float64], vertex: NDArray[np.int64], beside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least cosine between the normal of each vertex [k, 3] and those of its triangles."""
    worst = np.full(len(normal), np.inf)
    np.minimum.at(worst, vertex, np.einsum("ij,ij->i", normal[vertex], beside))
    return worst


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """As they are where they have no length."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)
