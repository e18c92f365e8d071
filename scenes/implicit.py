"""Implicit solids: signed-distance functions, smooth blends of them, and the triangle mesh of their surface.

A solid is a function from points [k, 3] to distances [k] in metres, negative inside. Blends join solids over a width
`k` in metres. Distances may be approximate away from the surface; the surface itself is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Sdf = Callable[[Array], Array]


def sphere(centre: ArrayLike, radius: float) -> Sdf:
    """Ball of a radius [m] about a centre [m]."""
    c = np.asarray(centre, dtype=np.float64)
    return lambda p: np.linalg.norm(p - c, axis=1) - radius


def ellipsoid(centre: ArrayLike, radii: ArrayLike, rotation: ArrayLike | None = None) -> Sdf:
    """Ellipsoid with semi-axes `radii` [m] along the columns of `rotation` (by default x, y, z).

    The distance is the first-order one, |q|(|q| - 1) / |grad|, with q the point in units of the semi-axes.
    """
    c, r = np.asarray(centre, dtype=np.float64), np.asarray(radii, dtype=np.float64)
    axes = np.eye(3) if rotation is None else np.asarray(rotation, dtype=np.float64)

    def distance(p: Array) -> Array:
        q = (p - c) @ axes / r
        length = np.linalg.norm(q, axis=1)
        slope = np.maximum(np.linalg.norm(q / r, axis=1), 1e-9)
        # at the very centre the quotient is 0/0; the smallest semi-axis is the distance there
        return np.where(length > 1e-9, length * (length - 1.0) / slope, -r.min())

    return distance


def rounded_cone(a: ArrayLike, b: ArrayLike, radius_a: float, radius_b: float) -> Sdf:
    """Hull of two balls at `a` and `b` [m] whose radius [m] goes linearly from one to the other."""
    start, axis = np.asarray(a, dtype=np.float64), np.subtract(b, a).astype(np.float64)
    length = float(np.linalg.norm(axis))
    sine = (radius_a - radius_b) / length
    cosine = np.sqrt(1.0 - sine * sine)

    def distance(p: Array) -> Array:
        along = (p - start) @ (axis / length)
        across = np.linalg.norm(p - start - along[:, None] * (axis / length), axis=1)
        # the ball nearest to p has its centre where p projects along the slanted side's normal
        t = np.clip((along - across * sine / cosine) / length, 0.0, 1.0)
        return np.hypot(along - t * length, across) - (radius_a + t * (radius_b - radius_a))

    return distance


def capsule(a: ArrayLike, b: ArrayLike, radius: float) -> Sdf:
    """All points within a radius [m] of the segment from `a` to `b` [m]."""
    return rounded_cone(a, b, radius, radius)


def pebble(centre: ArrayLike, radius: float, rounding: float, rotation: ArrayLike | None = None) -> Sdf:
    """All points within `rounding` [m] of a flat disc; its normal is the third column of `rotation`."""
    c = np.asarray(centre, dtype=np.float64)
    axes = np.eye(3) if rotation is None else np.asarray(rotation, dtype=np.float64)

    def distance(p: Array) -> Array:
        q = (p - c) @ axes
        outside = np.maximum(np.hypot(q[:, 0], q[:, 1]) - radius, 0.0)
        return np.hypot(outside, q[:, 2]) - rounding

    return distance


def half_space(normal: ArrayLike, offset: float) -> Sdf:
    """All points with normal . p <= offset [m]; the normal is a unit vector."""
    n = np.asarray(normal, dtype=np.float64)
    return lambda p: p @ n - offset


def smooth_union(k: float, *solids: Sdf) -> Sdf:
    """Union whose creases are filled over a width k [m], by the quadratic smooth minimum."""

    def distance(p: Array) -> Array:
        total = solids[0](p)
        for solid in solids[1:]:
            total = _smooth_minimum(total, solid(p), k)
        return total

    return distance


def smooth_intersection(k: float, solid: Sdf, other: Sdf) -> Sdf:
    """Intersection of two solids, with edges rounded over a width k [m]."""
    return lambda p: -_smooth_minimum(-solid(p), -other(p), k)


def mirrored(solid: Sdf) -> Sdf:
    """Join a solid given for y >= 0 with its mirror image in the plane y = 0."""
    return lambda p: solid(p * [1.0, 0.0, 1.0] + np.abs(p) * [0.0, 1.0, 0.0])


def _smooth_minimum(a: Array, b: Array, k: float) -> Array:
    blend = np.maximum(k - np.abs(a - b), 0.0)
    return np.minimum(a, b) - blend * blend / (4.0 * k)


def polygonise(
    sdf: Sdf, bounds: Sequence[ArrayLike], cell: float, smoothing: int = 12
) -> tuple[Array, NDArray[np.int64]]:
    """Triangulate the surface sdf = 0 evenly, by marching cubes and smoothing along the surface.

    Parameters
    ----------
    sdf : callable
        Signed distance of points [k, 3], negative inside [m].
    bounds : two points
        Lower and upper corner of a box that holds the whole solid [m].
    cell : float
        Edge of a marching cube [m]; the triangles' edges come out about as long.
    smoothing : int
        Rounds of vertex relaxation.

    Returns
    -------
    V, F
        Vertices [n, 3] float64 on the surface [m] and triangles [m, 3] int64, oriented outwards.
    """
    low, high = (np.asarray(corner, dtype=np.float64) for corner in bounds)
    counts = np.ceil((high - low) / cell).astype(int) + 1
    x, y, z = (low[i] + cell * np.arange(counts[i]) for i in range(3))
    grid = np.stack(np.meshgrid(z, y, x, indexing="ij")[::-1], axis=-1).reshape(-1, 3)
    V, F, _ = igl.marching_cubes(sdf(grid), grid, *(int(n) for n in counts), 0.0)
    V = project(sdf, V)
    for _ in range(smoothing):
        V = project(sdf, _relaxed(V, F))
    return V, F


def project(sdf: Sdf, points: Array, steps: int = 3) -> Array:
    """Move points [k, 3] that lie near the surface onto it, by Newton steps along the gradient."""
    for _ in range(steps):
        g = gradient(sdf, points)
        points = points - (sdf(points) / np.einsum("ij,ij->i", g, g))[:, None] * g
    return points


def gradient(sdf: Sdf, points: Array, step: float = 1e-5) -> Array:
    """Gradient of the distance at points [k, 3] by central differences, shape [k, 3]."""
    h = step * np.eye(3)
    return np.stack([sdf(points + e) - sdf(points - e) for e in h], axis=1) / (2 * step)


def _relaxed(V: Array, F: NDArray[np.int64]) -> Array:
    adjacency = igl.adjacency_matrix(F)
    return (adjacency @ V) / np.asarray(adjacency.sum(axis=1))
