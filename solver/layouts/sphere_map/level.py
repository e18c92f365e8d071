"""Levels of detail of a mesh, and the shape and area that triangles should have on the sphere.

*Carried area.* A collapsed vertex hands its share of the real surface on to the vertex it merges
with. So a limb that a coarse level no longer shows still gets its share of the sphere there, and
finds the room when it comes back.

The reference has the triangle's real shape, pulled towards an equilateral one where it is a sliver
(a sliver's cotangents would drown its neighbours' energy), and on the coarsest levels, where real
shapes mean little.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Floats, Ints32, kernel
from ...mesh.vectors import Vector, cross, dot, row, subtract
from ..energy import Reference
from .decimation import CornerTable, following, gather_star, preceding

# Area of a reference triangle, at least, over the mean area.
_MIN_AREA_SHARE = 1e-3

# Area that a level shows of a vertex, at least, over the area that the vertex carries; and the
# load, at most.
_MIN_SHOWN_SHARE = 1e-12
_MAX_LOAD = 1e6

# Mean squared side below which a triangle is a point, on a surface of area 4 pi; its reference is
# equilateral.
_MIN_SQUARED_SIDE = 1e-28

# Square of four times an area, at least: the area divides.
_MIN_SQUARED_AREA = 1e-300


class Level(NamedTuple):
    """Triangles and edges of a level, and the star of each vertex.

    A half-edge h is one of the level's 3 m.
    """

    tail: Ints32  # [3 m] vertex where a half-edge starts
    edge: Ints32  # [3 m] edge that a half-edge lies on
    # [e, 2] vertices of an edge; the half-edge that starts at the first one is the lower-numbered
    ends: Ints32
    star_start: Ints32  # [n + 1] where the neighbours of a vertex begin in `ring`
    ring: Ints32  # [3 m] neighbours of each vertex, counterclockwise
    star: Ints32  # [3 m] the half-edges to them


def build_level(
    table: CornerTable, vertices: NDArray[np.integer], triangles: NDArray[np.integer]
) -> Level:
    """Level made of the given vertices and triangles of a (partly collapsed) corner table."""
    corners = (3 * triangles[:, None] + np.arange(3)).ravel()
    vertex_number = _renumber(vertices, len(table.leaving))
    corner_number = _renumber(corners, len(table.tail))
    tail = vertex_number[table.tail[corners]]
    twin = corner_number[table.twin[corners]]
    lower = np.flatnonzero(np.arange(len(twin)) < twin)
    edge = np.empty(len(twin), dtype=np.int32)
    edge[lower] = np.arange(len(lower))
    edge[twin[lower]] = edge[lower]
    ends = np.stack([tail[lower], tail[twin[lower]]], axis=1)
    star_start = np.concatenate([[0], np.cumsum(np.bincount(tail))]).astype(np.int32)
    star = np.empty(star_start[-1], dtype=np.int32)
    h = table.leaving[vertices]
    place = star_start[:-1]
    end = star_start[1:]
    while len(h):  # one half-edge further counterclockwise round every vertex that has more
        star[place] = h
        has_more = np.flatnonzero(place + 1 < end)
        h = table.twin[preceding(h[has_more])]
        place = place[has_more] + 1
        end = end[has_more]
    ring = vertex_number[table.tail[table.twin[star]]]
    return Level(tail, edge, ends, star_start, ring, corner_number[star])


def star_shapes(star: Ints32, reference: Reference) -> Floats:
    """References [3 m, 4] of the triangles left of the half-edges `star`, for `expand_star`."""
    cotangent = reference.cotangent
    columns = (
        reference.area[star // 3],
        cotangent[star],
        cotangent[following(star)],
        cotangent[preceding(star)],
    )
    return np.stack(columns, axis=1)


def _renumber(chosen: NDArray[np.integer], count: int) -> Ints32:
    """The place of each of `count` things among the chosen ones; -1 for the others."""
    number = np.full(count, -1, dtype=np.int32)
    number[chosen] = np.arange(len(chosen))
    return number


class RealSurface(NamedTuple):
    """The surface as a level should resemble it."""

    V: Floats  # [n, 3] vertices; the total area is 4 pi
    carried: Floats  # [n] real area that each vertex stands for
    load: Floats  # [n] carried area over the area that the level shows
    trust: float  # in [0, 1], from equal equilateral triangles to the real ones
    # shape quality (1 is equilateral) below which a reference is pulled towards equilateral
    sliver: float
    mean: float  # reference area of an average triangle


def carry(removed: Ints32, merged_with: Ints32, carried: Floats) -> None:
    """Hand the area of each removed vertex on to the vertex that it merges with.

    The vertices are in the order of the collapses.
    """
    for u, v in zip(removed.tolist(), merged_with.tolist(), strict=True):
        carried[v] += carried[u]


@kernel
def _area(a: Vector, b: Vector, c: Vector) -> float:
    """Area of the triangle a, b, c."""
    normal = cross(subtract(b, a), subtract(c, a))
    return 0.5 * np.sqrt(dot(normal, normal))


@kernel
def update_load(v: int, star: Ints32, degree: int, tail: Ints32, surface: RealSurface) -> None:
    """Find the load of v: its carried area over its share of the real area that the level shows."""
    V = surface.V
    star_area = 0.0
    for i in range(degree):
        h = 3 * (star[i] // 3)
        star_area += _area(row(V, tail[h]), row(V, tail[h + 1]), row(V, tail[h + 2]))
    carried = surface.carried[v]
    shown = max(star_area / 3.0, _MIN_SHOWN_SHARE * carried)
    surface.load[v] = min(carried / shown, _MAX_LOAD)


@kernel
def update_triangle(f: int, tail: Ints32, surface: RealSurface, reference: Reference) -> None:
    """Set the reference of triangle f from its real shape and the loads of its corners."""
    u = tail[3 * f]
    v = tail[3 * f + 1]
    w = tail[3 * f + 2]
    a = row(surface.V, u)
    b = row(surface.V, v)
    c = row(surface.V, w)
    # the squared sides, opposite to the corners
    e0 = subtract(c, b)
    e1 = subtract(a, c)
    e2 = subtract(b, a)
    q0 = dot(e0, e0)
    q1 = dot(e1, e1)
    q2 = dot(e2, e2)
    real = _area(a, b, c)
    mean_square = (q0 + q1 + q2) / 3.0
    if mean_square > _MIN_SQUARED_SIDE:
        quality = 4.0 / np.sqrt(3.0) * real / mean_square
        pull = max(1.0 - min(quality / surface.sliver, 1.0), 1.0 - surface.trust)
        q0 = q0 + pull * (mean_square - q0)
        q1 = q1 + pull * (mean_square - q1)
        q2 = q2 + pull * (mean_square - q2)
    else:
        q0 = q1 = q2 = 1.0
    loads = surface.load[u] + surface.load[v] + surface.load[w]
    area = max(real * loads / 3.0, _MIN_AREA_SHARE * surface.mean)
    if surface.trust < 1.0:
        area = area**surface.trust * surface.mean ** (1.0 - surface.trust)
    # Heron's formula, and cotangents by the law of cosines
    products = 2.0 * (q0 * q1 + q1 * q2 + q2 * q0)
    four_areas = np.sqrt(max(products - (q0 * q0 + q1 * q1 + q2 * q2), _MIN_SQUARED_AREA))
    scale = 0.5 / (four_areas * area)
    reference.area[f] = area
    reference.cotangent[3 * f] = scale * (q1 + q2 - q0)
    reference.cotangent[3 * f + 1] = scale * (q2 + q0 - q1)
    reference.cotangent[3 * f + 2] = scale * (q0 + q1 - q2)


@kernel
def update_level(
    vertices: Ints32,
    triangles: Ints32,
    table: CornerTable,
    surface: RealSurface,
    reference: Reference,
) -> None:
    """Set the references of a whole level, their areas summing to the sphere's 4 pi."""
    star = np.empty(len(surface.V), np.int32)
    for v in vertices:
        update_load(v, star, gather_star(table, v, star), table.tail, surface)
    total = 0.0
    for f in triangles:
        update_triangle(f, table.tail, surface, reference)
        total += reference.area[f]
    scale = 4.0 * np.pi / total
    for f in triangles:
        reference.area[f] *= scale
        for h in range(3 * f, 3 * f + 3):
            reference.cotangent[h] /= scale
