"""Shipped target meshes that are no closed surface of genus 0: a teapot, a pretzel.

`python examples/scene_meshes/vessels.py` writes `scenes/meshes/teapot.obj` and
`scenes/meshes/pretzel.obj` again.
"""

from __future__ import annotations

from pathlib import Path

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from ripple_sim.scenes.shapes import (
    Array,
    Sdf,
    Triangles,
    ellipsoid,
    half_space,
    polygonise,
    project,
    rounded_cone,
    smooth_intersection,
    smooth_union,
    sphere,
    write_obj,
)

TEAPOT_FILE = Path(__file__).parents[2] / "scenes" / "meshes" / "teapot.obj"
PRETZEL_FILE = TEAPOT_FILE.with_name("pretzel.obj")

_RIM = 0.42  # height of the teapot's opening [m]
# of the spout, and where it opens
_TIP = (0.53, 0.0, 0.365)
_POUR = (0.75, 0.0, 0.66)


def teapot(cell: float = 0.02) -> tuple[Array, Triangles]:
    """Model a teapot 1 m long with a handle, two openings and a lid.

    It is open at the top and at the tip of the spout; the lid lies on it.

    Parameters
    ----------
    cell : float
        Edge of the triangles, roughly [m].

    Returns
    -------
    V, F
        Vertices [n, 3] float64 [m] and triangles [m, 3] int64, oriented outwards: two open parts,
        one with a handle.
    """
    belly = smooth_intersection(
        0.04, ellipsoid((0.0, 0.0, 0.24), (0.34, 0.34, 0.235)), half_space((0.0, 0.0, -1.0), -0.035)
    )
    neck = rounded_cone((0.0, 0.0, 0.36), (0.0, 0.0, 0.56), 0.19, 0.17)
    spout = tube(
        [
            (0.22, 0.0, 0.13),
            (0.36, 0.0, 0.17),
            (0.44, 0.0, 0.25),
            (0.51, 0.0, 0.34),
            (0.60, 0.0, 0.44),
        ],
        0.078,
        0.043,
    )
    handle = tube(
        [
            (-0.27, 0.0, 0.30),
            (-0.40, 0.0, 0.345),
            (-0.50, 0.0, 0.28),
            (-0.47, 0.0, 0.16),
            (-0.31, 0.0, 0.10),
        ],
        0.036,
    )
    pot = smooth_union(0.06, smooth_union(0.05, belly, neck), spout, handle)
    V, F = polygonise(pot, ((-0.56, -0.38, -0.03), (0.68, 0.38, 0.78)), cell)
    V, F = opened(pot, V, F, (0.0, 0.0, _RIM), (0.0, 0.0, 1.0), cell)
    V, F = opened(pot, V, F, _TIP, _POUR, cell)
    lid = smooth_union(
        0.05,
        ellipsoid((0.0, 0.0, _RIM - 0.01), (0.265, 0.265, 0.08)),
        sphere((0.0, 0.0, 0.525), 0.04),
    )
    lid_V, lid_F = polygonise(lid, ((-0.3, -0.3, 0.3), (0.3, 0.3, 0.6)), cell)
    lid_V, lid_F = opened(lid, lid_V, lid_F, (0.0, 0.0, _RIM + 0.004), (0.0, 0.0, -1.0), cell)
    return np.concatenate([V, lid_V]) - [0.0, 0.0, V[:, 2].min()], np.concatenate(
        [F, lid_F + len(V)]
    )


def pretzel(cell: float = 0.02) -> tuple[Array, Triangles]:
    """Model a pretzel 1 m wide on z = 0, a closed surface of genus 3; cell as for `teapot`."""
    course = [
        (0.13, -0.30),
        (0.07, -0.17),
        (-0.05, 0.01),
        (-0.20, 0.20),
        (-0.38, 0.17),
        (-0.45, -0.02),
        (-0.35, -0.22),
    ]
    course += [(-0.20, -0.315), (0.0, -0.345)]
    left, right = ([(side * x, y, 0.0) for x, y in course] for side in (1, -1))
    dough = smooth_union(0.03, tube(left, 0.052, 0.067), tube(right, 0.052, 0.067))
    V, F = polygonise(dough, ((-0.6, -0.5, -0.12), (0.6, 0.35, 0.12)), cell)
    return V - [0.0, 0.0, V[:, 2].min()], F


def tube(
    course: ArrayLike, radius: float, last_radius: float | None = None, segments: int = 40
) -> Sdf:
    """Round tube along a smooth curve through points [k, 3] [m]; the radius changes evenly [m]."""
    points = np.asarray(course, dtype=np.float64)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    curve = CubicSpline(along, points)(np.linspace(0.0, along[-1], segments + 1))
    radii = np.linspace(radius, radius if last_radius is None else last_radius, segments + 1)
    cones = [
        rounded_cone(*ends)
        for ends in zip(curve[:-1], curve[1:], radii[:-1], radii[1:], strict=True)
    ]
    return lambda p: np.min([cone(p) for cone in cones], axis=0)


def opened(
    sdf: Sdf, V: Array, F: Triangles, point: ArrayLike, normal: ArrayLike, cell: float
) -> tuple[Array, NDArray[np.int64]]:
    """Cut the surface sdf = 0 open: leave out what lies beyond a plane.

    The plane has a point [m] and a normal. Vertices near the plane are first moved onto the curve
    where it cuts the surface, so that no slivers arise.
    """
    point = np.asarray(point, dtype=np.float64)
    normal = np.asarray(normal, dtype=np.float64)
    normal = normal / np.linalg.norm(normal)
    near = np.abs((V - point) @ normal) < 0.4 * cell
    V = V.copy()
    for _ in range(12):
        V[near] = project(sdf, V[near] - ((V[near] - point) @ normal)[:, None] * normal, steps=1)
    V[near] -= ((V[near] - point) @ normal)[:, None] * normal
    V, F = _clipped(V, F, np.where(near, 0.0, (V - point) @ normal))
    free = np.ones(len(V), dtype=bool)
    free[igl.boundary_facets(F)[0].ravel()] = False
    adjacency = igl.adjacency_matrix(F)
    for _ in range(6):
        relaxed = (adjacency @ V) / np.asarray(adjacency.sum(axis=1))
        V[free] = project(sdf, relaxed[free])
    return V, F


def _clipped(V: Array, F: Triangles, beyond: Array) -> tuple[Array, Triangles]:
    """Part of a triangulation where a linear function, given at the vertices [n], is negative."""
    count = (beyond[F] > 0).sum(axis=1)
    crossing = F[(count > 0) & (beyond[F].min(axis=1) < 0)]
    turn = np.where(
        (beyond[crossing] > 0).sum(axis=1) == 1,
        beyond[crossing].argmax(1),
        beyond[crossing].argmin(1),
    )
    a, b, c = np.take_along_axis(crossing, (turn[:, None] + np.arange(3)) % 3, axis=1).T
    ends = np.sort(np.stack([np.stack([a, b], axis=1), np.stack([a, c], axis=1)]), axis=2)
    edges, index = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    share = beyond[edges[:, 0]] / (beyond[edges[:, 0]] - beyond[edges[:, 1]])
    cut = np.where(
        share == 0, edges[:, 0], np.where(share == 1, edges[:, 1], len(V) + np.arange(len(edges)))
    )
    to_b, to_c = cut[index.reshape(2, -1)]
    lone = beyond[a] < 0  # else a alone lies beyond
    kept = [
        F[(count == 0) & (beyond[F].min(axis=1) < 0)],
        np.stack([a, to_b, to_c], axis=1)[lone],
        np.stack([to_b, b, c], axis=1)[~lone],
        np.stack([to_b, c, to_c], axis=1)[~lone],
    ]
    triangles = np.concatenate(kept)
    points = np.concatenate(
        [V, V[edges[:, 0]] + share[:, None] * (V[edges[:, 1]] - V[edges[:, 0]])]
    )
    distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    used, triangles = np.unique(triangles[distinct], return_inverse=True)
    return points[used], triangles.reshape(-1, 3)


if __name__ == "__main__":
    write_obj(TEAPOT_FILE, *teapot())
    write_obj(PRETZEL_FILE, *pretzel())
