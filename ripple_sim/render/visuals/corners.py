"""Corners of a mesh's triangles: their normals, and vertices that are split where normals jump."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


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
    smooth = np.zeros((len(V), 3))
    smooth[F] = corner_normals(V, F, crease=180.0)
    return smooth


def corner_normals(V: NDArray, F: NDArray, crease: float = 45.0) -> NDArray[np.float64]:
    """Angle-weighted unit normals of every triangle's corners, shape [m, 3, 3].

    Triangles at more than `crease` degrees to the corner's own do not count, so sharp edges stay sharp; 180 gives one
    smooth normal a vertex.
    """
    triangle = triangle_normals(V, F)
    weighted = (_corner_angles(V, F)[:, :, None] * triangle[:, None, :]).reshape(-1, 3)
    # every ordered pair of corners that share a vertex
    corners = np.argsort(F.ravel(), kind="stable")
    degree = np.bincount(F.ravel(), minlength=len(V))
    count = degree[F.ravel()[corners]]
    one = np.repeat(np.arange(len(corners)), count)
    start = np.repeat((np.cumsum(degree) - degree)[F.ravel()[corners]], count)
    other = start + np.arange(len(one)) - np.repeat(np.cumsum(count) - count, count)
    one, other = corners[one], corners[other]
    close = np.einsum("ij,ij->i", triangle[one // 3], triangle[other // 3]) >= np.cos(np.radians(crease)) - 1e-9
    normals = np.zeros_like(weighted)
    np.add.at(normals, one[close], weighted[other[close]])
    return normalized(normals).reshape(len(F), 3, 3)


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
