"""Triangles as a file gives them, and polygons cut into triangles.

A polygon becomes a fan of triangles. Where a triangle of the fan would be folded over, because the
polygon is not convex, ears are clipped instead.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from .clean import counted
from .looks import Looks


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
    looks : Looks or None
        The materials and colours of the triangles.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    corner_uv: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()
    looks: Looks | None = None


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
    first_corner = np.cumsum(sizes) - sizes
    count = np.maximum(sizes - 2, 0)
    polygon_of = np.repeat(np.arange(len(sizes)), count)
    first_triangle = np.cumsum(count) - count
    # a triangle's place in the fan of its polygon, from 0
    step = np.arange(count.sum()) - np.repeat(first_triangle, count)
    apex = first_corner[polygon_of]
    triangles = np.stack([apex, apex + step + 1, apex + step + 2], axis=1)
    for polygon in _polygons_with_folded_fans(points, sizes, triangles, polygon_of):
        start = first_corner[polygon]
        corners = points[start : start + sizes[polygon]]
        triangles[polygon_of == polygon] = start + _clip_ears(corners)
    return triangles


def _polygons_with_folded_fans(
    points: NDArray[np.float64],
    sizes: NDArray[np.int64],
    triangles: NDArray[np.int64],
    polygon_of: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Polygons that are not convex: a triangle of their fan faces against the sum of all."""
    large = np.flatnonzero(sizes[polygon_of] > 3)
    a, b, c = (points[triangles[large, k]] for k in range(3))
    # values that are not finite are refused later, by name
    with np.errstate(over="ignore", invalid="ignore"):
        normals = np.cross(b - a, c - a)
    polygon = polygon_of[large]
    total = np.stack(
        [np.bincount(polygon, normals[:, k], minlength=len(sizes)) for k in range(3)], axis=1
    )
    against = np.einsum("ij,ij->i", normals, total[polygon]) < 0
    return np.unique(polygon[against])


def _clip_ears(corners: NDArray[np.float64]) -> NDArray[np.int64]:
    """Triangles [n - 2, 3] of one simple polygon [n, 3], seen along its normal (Meisters 1975)."""
    # Newell's normal is the normal of the best plane. Dropping its largest coordinate flattens the
    # polygon without a rotation.
    normal = np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(corners, axis, axis=1)
    if (normal[axis] < 0) != (axis == 1):  # dropping y mirrors
        flat = flat * [1, -1]
    remaining = list(range(len(corners)))
    triangles = []
    while len(remaining) > 3:
        ears = (i for i in range(len(remaining)) if _is_ear(flat, remaining, i))
        ear = next(ears, 0)
        triangles.append(_corner_with_neighbours(remaining, ear))
        del remaining[ear]
    return np.array([*triangles, remaining])


def _corner_with_neighbours(remaining: list[int], i: int) -> list[int]:
    """Corner i of a polygon between the corner before it and the corner after it."""
    return [remaining[i - 1], remaining[i], remaining[(i + 1) % len(remaining)]]


def _is_ear(flat: NDArray[np.float64], remaining: list[int], i: int) -> bool:
    """Whether corner i of a polygon is convex, and its triangle holds no other corner."""
    triangle = _corner_with_neighbours(remaining, i)
    a, b, c = flat[triangle]
    if _turn(a, b, c[None])[0] <= 0:
        return False
    others = flat[[k for k in remaining if k not in triangle]]
    inside = (_turn(a, b, others) >= 0) & (_turn(b, c, others) >= 0) & (_turn(c, a, others) >= 0)
    return not inside.any()


def _turn(
    a: NDArray[np.float64], b: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Twice the signed area of the triangles a, b, point."""
    return (b[0] - a[0]) * (points[:, 1] - a[1]) - (b[1] - a[1]) * (points[:, 0] - a[0])
