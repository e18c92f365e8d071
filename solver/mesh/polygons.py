"""Polygons of a mesh file cut into triangles: by a fan, or by clipping ears where a fan folds."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .counting import counted


@dataclasses.dataclass(frozen=True)
class Soup:
    """Triangles read from a file, not validated.

    Attributes
    ----------
    V : float64 [vertex_count, 3]
    F : int64 [triangle_count, 3]
    corner_uv : float64 [triangle_count, 3, 2] or None
        Texture coordinates of the corners; 0 where the file has none for some of them.
    notes : tuple of str
        What was left out, one line each.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    corner_uv: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()


def too_small(sizes: NDArray[np.int64]) -> tuple[str, ...]:
    """Note on faces of fewer than three corners [face_count], if there are any."""
    count = int((sizes < 3).sum())
    return (f"{counted(count, 'face')} with fewer than three corners left out",) if count else ()


def triangulate(points: NDArray[np.float64], sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cut polygons into triangles of the same winding.

    Parameters
    ----------
    points : [corner_count, 3]
        Corners, polygon after polygon.
    sizes : [polygon_count]
        Corners of each polygon. Those of fewer than three (points and lines) give no triangle.

    Returns
    -------
    int64 [triangle_count, 3]
        Indices of corners, in the order of the polygons.
    """
    first = np.cumsum(sizes) - sizes
    count = np.maximum(sizes - 2, 0)
    owner = np.repeat(np.arange(len(sizes)), count)
    step = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    triangles = np.stack([first[owner], first[owner] + step + 1, first[owner] + step + 2], axis=1)
    for polygon in _folded(points, triangles, owner, sizes):
        corners = points[first[polygon] : first[polygon] + sizes[polygon]]
        triangles[owner == polygon] = first[polygon] + _clip_ears(corners)
    return triangles


def _folded(
    points: NDArray[np.float64], triangles: NDArray[np.int64], owner: NDArray[np.int64], sizes: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Polygons that are not convex: a triangle of their fan faces against the sum of all."""
    many = np.flatnonzero(sizes[owner] > 3)
    a, b, c = (points[triangles[many, k]] for k in range(3))
    with np.errstate(over="ignore", invalid="ignore"):  # values that are not finite are refused later, by name
        normals = np.cross(b - a, c - a)
    polygon = owner[many]
    total = np.stack([np.bincount(polygon, normals[:, k], minlength=len(sizes)) for k in range(3)], axis=1)
    against = np.einsum("ij,ij->i", normals, total[polygon]) < 0
    return np.unique(polygon[against])


def _clip_ears(corners: NDArray[np.float64]) -> NDArray[np.int64]:
    """Triangles [n - 2, 3] of one simple polygon [n, 3], seen along its normal (Meisters 1975)."""
    # Newell's normal is that of the best plane; an axis pair that suits it spares a rotation
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(corners, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):  # dropping y mirrors
        flat = flat * [1, -1]
    left = list(range(len(corners)))
    triangles = []
    while len(left) > 3:
        at = next((i for i in range(len(left)) if _is_ear(flat, left, i)), 0)
        triangles.append([left[at - 1], left[at], left[(at + 1) % len(left)]])
        del left[at]
    return np.array([*triangles, left])


def _is_ear(flat: NDArray[np.float64], left: list[int], at: int) -> bool:
    a, b, c = flat[left[at - 1]], flat[left[at]], flat[left[(at + 1) % len(left)]]
    if _turn(a, b, c[None])[0] <= 0:
        return False
    others = flat[[k for k in left if k not in (left[at - 1], left[at], left[(at + 1) % len(left)])]]
    inside = (_turn(a, b, others) >= 0) & (_turn(b, c, others) >= 0) & (_turn(c, a, others) >= 0)
    return not inside.any()


def _turn(a: NDArray[np.float64], b: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Twice the signed area of the triangles a, b, point."""
    return (b[0] - a[0]) * (points[:, 1] - a[1]) - (b[1] - a[1]) * (points[:, 0] - a[0])
