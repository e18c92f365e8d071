"""The shipped target meshes: closed surfaces of genus 0, modelled with implicit solids.

`python -m ripple_sim.scenes.shapes` writes `meshes/duck.obj` and `meshes/limbed.obj` again.

Implicit solids: signed-distance functions, smooth blends of them, and the triangle mesh of their
surface.

A solid is a function from points [k, 3] to distances [k] in metres, negative inside. Blends join
solids over a width `k` in metres. Distances may be approximate away from the surface; the surface
itself is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver.files import atomic_write

__all__ = ["DUCK_FILE", "LIMBED_FILE", "duck", "limbed", "peanut", "polygonise", "write_obj"]

Array = NDArray[np.float64]
Triangles = NDArray[np.int64]
Sdf = Callable[[Array], Array]

DUCK_FILE = Path(__file__).parent / "meshes" / "duck.obj"
LIMBED_FILE = DUCK_FILE.with_name("limbed.obj")


def sphere(centre: ArrayLike, radius: float) -> Sdf:
    """Ball of a radius [m] about a centre [m]."""
    c = np.asarray(centre, dtype=np.float64)
    return lambda p: np.linalg.norm(p - c, axis=1) - radius


def ellipsoid(centre: ArrayLike, radii: ArrayLike, rotation: ArrayLike | None = None) -> Sdf:
    """Ellipsoid with semi-axes `radii` [m] along the columns of `rotation` (by default x, y, z).

    The distance is the first-order one, |q|(|q| - 1) / |grad|, with q the point in units of the
    semi-axes.
    """
    c = np.asarray(centre, dtype=np.float64)
    r = np.asarray(radii, dtype=np.float64)
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
    start = np.asarray(a, dtype=np.float64)
    axis = np.subtract(b, a).astype(np.float64)
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


def pebble(
    centre: ArrayLike, radius: float, rounding: float, rotation: ArrayLike | None = None
) -> Sdf:
    """All points within `rounding` [m] of a flat disc.

    The disc's normal is the third column of `rotation`.
    """
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
) -> tuple[Array, Triangles]:
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


def _relaxed(V: Array, F: Triangles) -> Array:
    adjacency = igl.adjacency_matrix(F)
    return (adjacency @ V) / np.asarray(adjacency.sum(axis=1))


def duck(cell: float = 0.0235) -> tuple[Array, Triangles]:
    """Model a bath duck about 1 m long that faces +x and stands on z = 0.

    It is symmetric about y = 0, except for the triangulation.

    Parameters
    ----------
    cell : float
        Edge of the triangles, roughly [m].

    Returns
    -------
    V, F
        Vertices [n, 3] float64 [m] and triangles [m, 3] int64, oriented outwards.
    """
    V, F = polygonise(_duck_solid(), ((-0.6, -0.45, -0.03), (0.6, 0.45, 0.95)), cell)
    return V - [0.0, 0.0, V[:, 2].min()], F


def limbed(cell: float = 0.02) -> tuple[Array, Triangles]:
    """Model a plump animal on four legs, 0.7 m long, standing on z = 0.

    It is concave between the legs and under the chin.
    """
    legs = []
    for x in (-0.17, 0.17):
        for y in (-0.09, 0.09):
            legs.append(capsule((x, y, 0.22), (1.25 * x, 1.4 * y, 0.05), 0.05))
    trunk = ellipsoid((0.0, 0.0, 0.3), (0.27, 0.15, 0.14))
    neck = rounded_cone((0.18, 0.0, 0.34), (0.3, 0.0, 0.5), 0.08, 0.06)
    head = ellipsoid((0.33, 0.0, 0.52), (0.12, 0.085, 0.085))
    solid = smooth_union(0.05, trunk, *legs, neck, head)
    V, F = polygonise(solid, ((-0.35, -0.25, -0.06), (0.52, 0.25, 0.7)), cell)
    return V - [0.0, 0.0, V[:, 2].min()], F


def peanut(cell: float = 0.02) -> tuple[Array, Triangles]:
    """Model two blended balls along x, 0.7 m long, centred at the origin.

    The surface is smooth, with a saddle all round its waist.
    """
    solid = smooth_union(0.12, sphere((-0.17, 0.0, 0.0), 0.18), sphere((0.17, 0.0, 0.0), 0.18))
    return polygonise(solid, ((-0.4, -0.25, -0.25), (0.4, 0.25, 0.25)), cell)


def _duck_solid() -> Sdf:
    torso = smooth_union(
        0.12,
        ellipsoid((-0.06, 0.0, 0.24), (0.39, 0.31, 0.25)),
        sphere((0.14, 0.0, 0.26), 0.26),  # the breast
        rounded_cone((-0.27, 0.0, 0.29), (-0.46, 0.0, 0.50), 0.17, 0.05),  # the tail
    )
    wing = smooth_union(
        0.10,
        ellipsoid((-0.05, 0.285, 0.30), (0.17, 0.065, 0.115), _turned(pitch=0.15, yaw=0.12)),
        rounded_cone((-0.14, 0.30, 0.32), (-0.27, 0.29, 0.41), 0.065, 0.035),
    )
    torso = smooth_union(0.04, torso, mirrored(wing))
    neck = rounded_cone((0.14, 0.0, 0.40), (0.19, 0.0, 0.58), 0.18, 0.16)
    head = sphere((0.19, 0.0, 0.68), 0.222)
    bill = smooth_union(
        0.025,
        pebble((0.415, 0.0, 0.663), 0.085, 0.034, _turned(pitch=-0.20)),
        pebble((0.40, 0.0, 0.605), 0.060, 0.030, _turned(pitch=0.12)),
    )
    eye = sphere((0.325, 0.118, 0.755), 0.052)
    solid = smooth_union(0.08, torso, smooth_union(0.05, neck, head))
    solid = smooth_union(0.035, solid, bill)
    solid = smooth_union(0.02, solid, mirrored(eye))
    return smooth_intersection(0.04, solid, half_space((0.0, 0.0, -1.0), -0.035))


def _turned(pitch: float = 0.0, yaw: float = 0.0) -> Array:
    """Rotation by `pitch` about y (positive noses down), then by `yaw` about z [rad]."""
    cp = np.cos(pitch)
    sp = np.sin(pitch)
    cy = np.cos(yaw)
    sy = np.sin(yaw)
    return np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ np.array(
        [[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]]
    )


def write_obj(path: Path, V: Array, F: Triangles) -> None:
    """Write a Wavefront file, whole or not at all.

    Vertices have five significant digits.
    """
    lines = ["# made by python -m ripple_sim.scenes.shapes"]
    lines += [f"v {x:.5g} {y:.5g} {z:.5g}" for x, y, z in V]
    lines += [f"f {a} {b} {c}" for a, b, c in F + 1]
    with atomic_write(path) as unfinished:
        unfinished.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    write_obj(DUCK_FILE, *duck())
    write_obj(LIMBED_FILE, *limbed())
