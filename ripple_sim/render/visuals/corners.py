"""Corners of a mesh's triangles: their normals, and vertices that are split where normals jump."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ripple_sim.solver.mesh.topology import undirected

_ASTRAY = 60.0  # [degrees] between a triangle's normal and the one that it shares at a vertex


class SplitMesh(NamedTuple):
    """A mesh with one vertex for each of a vertex's normals and texture coordinates.

    Attributes
    ----------
    vertices : int64 [n]
        The vertex of the original mesh.
    F : int64 [m, 3]
    normals : float64 [n, 3]
    uv : float64 [n, 2]
    coordinates : float64 [n, d]
    """

    vertices: NDArray[np.int64]
    F: NDArray[np.int64]
    normals: NDArray[np.float64]
    uv: NDArray[np.float64]
    coordinates: NDArray[np.float64]


def split_corners(
    V: NDArray,
    F: NDArray,
    corner_uv: NDArray | None = None,
    coordinates: NDArray | None = None,
    normals: NDArray | None = None,
) -> SplitMesh:
    """Split vertices where normals, texture coordinates [m, 3, 2] or other coordinates [m, 3, d] jump.

    The normals, [m, 3, 3], are those of `corner_normals` unless given.
    """
    normals = corner_normals(V, F) if normals is None else normals
    uv = np.zeros((*F.shape, 2)) if corner_uv is None else corner_uv
    others = np.zeros((*F.shape, 0)) if coordinates is None else coordinates
    corners = np.concatenate([F[:, :, None], normals, uv, others], axis=2)
    unique, index = np.unique(corners.reshape(F.size, -1), axis=0, return_inverse=True)
    return SplitMesh(
        unique[:, 0].astype(np.int64), index.reshape(F.shape), unique[:, 1:4], unique[:, 4:6], unique[:, 6:]
    )


def smooth_normals(V: NDArray, F: NDArray) -> NDArray[np.float64]:
    """One normal a vertex, shape [n, 3]; zero where a vertex has no triangle."""
    return _sums(_weighted(V, F), F.ravel(), len(V))


def corner_normals(V: NDArray, F: NDArray, crease: float = 45.0) -> NDArray[np.float64]:
    """Angle-weighted unit normals of every triangle's corners, shape [m, 3, 3].

    The triangles round a vertex share one normal from crease to crease, edges that bend by more than `crease` degrees:
    sharp edges stay sharp and run out smoothly where they end. A triangle that is turned far away from that normal, as
    at the tip of a cone, keeps its own.
    """
    own = np.repeat(triangle_normals(V, F), 3, axis=0)
    fan = _fans(F, own[::3], crease)
    shared = _sums(_weighted(V, F), fan, len(fan))[fan]
    far = (np.einsum("ij,ij->i", shared, own) < np.cos(np.radians(_ASTRAY))) & own.any(axis=1)
    return np.where(far[:, None], own, shared).reshape(len(F), 3, 3)


def _fans(F: NDArray, triangle: NDArray[np.float64], crease: float) -> NDArray[np.int64]:
    """Numbers of the corners [3 m] that are equal where their triangles hang together round a vertex."""
    ends = np.stack([F, np.roll(F, -1, axis=1)], axis=2).reshape(-1, 2)
    number = np.arange(F.size).reshape(F.shape)
    corners = np.stack([number, np.roll(number, -1, axis=1)], axis=2).reshape(-1, 2)
    corners = np.take_along_axis(corners, ends.argsort(axis=1), axis=1)
    _, edge, count = np.unique(undirected(F)[0], return_inverse=True, return_counts=True)
    order = np.argsort(edge, kind="stable")
    one, other = order[count[edge[order]] == 2].reshape(-1, 2).T
    a, b = triangle[one // 3], triangle[other // 3]
    # a triangle without area bends nowhere
    even = (np.einsum("ij,ij->i", a, b) >= np.cos(np.radians(crease)) - 1e-9) | ~a.any(axis=1) | ~b.any(axis=1)
    pairs = np.stack([corners[one[even]], corners[other[even]]], axis=1).reshape(-1, 2, 2)
    i, j = pairs[:, 0].ravel(), pairs[:, 1].ravel()
    return connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(F.size, F.size)), directed=False)[1]


def _weighted(V: NDArray, F: NDArray) -> NDArray[np.float64]:
    """Normals of the triangles, weighted with their angles at the corners [3 m, 3]."""
    return (_corner_angles(V, F)[:, :, None] * triangle_normals(V, F)[:, None, :]).reshape(-1, 3)


def _sums(weighted: NDArray[np.float64], group: NDArray, count: int) -> NDArray[np.float64]:
    """Unit sums of vectors [k, 3] that belong to the same of `count` groups [k]."""
    return normalized(np.stack([np.bincount(group, column, count) for column in weighted.T], axis=1))


def triangle_normals(V: NDArray, F: NDArray) -> NDArray[np.float64]:
    """Unit normals of triangles, shape [m, 3]; zero where a triangle has no area."""
    return normalized(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]))


def _corner_angles(V: NDArray, F: NDArray) -> NDArray[np.float64]:
    sides = normalized(V[np.roll(F, -1, axis=1)] - V[F])
    return np.arccos(np.clip(np.einsum("fkj,fkj->fk", sides, -np.roll(sides, 1, axis=1)), -1.0, 1.0))


def normalized(vectors: NDArray) -> NDArray[np.float64]:
    """Unit vectors of vectors [..., k]; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)
