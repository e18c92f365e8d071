"""One level of detail of the mesh, its vertices and triangles renumbered without gaps.

Reference triangles: the shape and area that each triangle of a coarse level should have on the sphere.

*Carried area.* A collapsed vertex hands its share of the real surface on to the vertex it merges with. So a limb that a
coarse level no longer shows still gets its share of the sphere there, and finds the room when it comes back.

The reference has the triangle's real shape, pulled towards an equilateral one where it is a sliver (a sliver's
cotangents would drown its neighbours' energy), and on the coarsest levels, where real shapes mean little.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Floats, Ints32, kernel
from .decimation import CornerTable, following, gather_star, preceding
from .energy import Reference, cross, dot, row, subtract


class Level(NamedTuple):
    """Triangles of a level, its edges, and the star of each vertex; h is one of the level's 3 m half-edges."""

    tail: Ints32  # [3 m] vertex where a half-edge starts
    edge: Ints32  # [3 m] edge that a half-edge lies on
    ends: Ints32  # [e, 2] vertices of an edge; the half-edge that starts at the first one is the lower-numbered
    star_start: Ints32  # [n + 1] where the neighbours of a vertex begin in `ring`
    ring: Ints32  # [3 m] neighbours of each vertex, counterclockwise
    star: Ints32  # [3 m] the half-edges to them


def build_level(table: CornerTable, vertices: NDArray[np.integer], triangles: NDArray[np.integer]) -> Level:
    """Level made of the given vertices and triangles of a (partly collapsed) corner table."""
    corners = (3 * triangles[:, None] + np.arange(3)).ravel()
    vertex_number, corner_number = _renumber(vertices, len(table.leaving)), _renumber(corners, len(table.tail))
    tail, twin = vertex_number[table.tail[corners]], corner_number[table.twin[corners]]
    lower = np.flatnonzero(np.arange(len(twin)) < twin)
    edge = np.empty(len(twin), dtype=np.int32)
    edge[lower] = edge[twin[lower]] = np.arange(len(lower))
    ends = np.stack([tail[lower], tail[twin[lower]]], axis=1)
    star_start = np.concatenate([[0], np.cumsum(np.bincount(tail))]).astype(np.int32)
    star = np.empty(len(tail), dtype=np.int32)
    _gather_stars(vertices, table, star_start, star)
    ring = vertex_number[table.tail[table.twin[star]]]
    return Level(tail, edge, ends, star_start, ring, corner_number[star])


@kernel
def _gather_stars(vertices: Ints32, table: CornerTable, star_start: Ints32, star: Ints32) -> None:
    """Fill `star` [3 m] with the half-edges round each vertex, from `star_start` [n + 1] on."""
    for i in range(len(vertices)):
        gather_star(table, vertices[i], star[star_start[i] : star_start[i + 1]])


@kernel
def set_shape(shapes: Floats, i: int, h: int, reference: Reference) -> None:
    """Write the reference of the triangle of half-edge h into row i: area, and cotangents at tail, head and apex."""
    shapes[i, 0] = reference.area[h // 3]
    shapes[i, 1] = reference.cotangent[h]
    shapes[i, 2] = reference.cotangent[following(h)]
    shapes[i, 3] = reference.cotangent[preceding(h)]


@kernel
def star_shapes(star: Ints32, reference: Reference) -> Floats:
    """References of the triangles left of the half-edges `star`, one after the other in memory, shape [3 m, 4]."""
    shapes = np.empty((len(star), 4))
    for i in range(len(star)):
        set_shape(shapes, i, star[i], reference)
    return shapes


def _renumber(kept: NDArray[np.integer], count: int) -> Ints32:
    number = np.full(count, -1, dtype=np.int32)
    number[kept] = np.arange(len(kept))
    return number


SMALLEST_SHARE = 1e-3  # of the mean reference area: no triangle gets less


class Source(NamedTuple):
    """The real surface as a level should resemble it."""

    V: Floats  # [n, 3] vertices; the total area is 4 pi
    carried: Floats  # [n] real area that each vertex stands for
    load: Floats  # [n] carried area over the area that the level shows
    trust: float  # in [0, 1], from equal equilateral triangles to the real ones
    sliver: float  # shape quality (1 is equilateral) below which a reference is pulled towards equilateral
    mean: float  # reference area of an average triangle


@kernel
def _real_area(tail: Ints32, f: int, V: Floats) -> float:
    """Real area of triangle f."""
    p = row(V, tail[3 * f])
    normal = cross(subtract(row(V, tail[3 * f + 1]), p), subtract(row(V, tail[3 * f + 2]), p))
    return 0.5 * np.sqrt(dot(normal, normal))


@kernel
def carry(removed: Ints32, kept: Ints32, carried: Floats) -> None:
    """Hand the area of each removed vertex on to the one it merges with, in the order of the collapses."""
    for i in range(len(removed)):
        carried[kept[i]] += carried[removed[i]]


@kernel
def update_load(v: int, star: Ints32, degree: int, tail: Ints32, source: Source) -> None:
    """Find the load of v: the area it carries over its share of the real area that the level still shows."""
    shown = 0.0
    for i in range(degree):
        shown += _real_area(tail, star[i] // 3, source.V)
    carried = source.carried[v]
    source.load[v] = min(carried / max(shown / 3.0, 1e-12 * carried), 1e6)


@kernel
def update_triangle(f: int, tail: Ints32, source: Source, reference: Reference) -> None:
    """Set the reference of triangle f from its real shape and the loads of its corners."""
    V = source.V
    a, b, c = tail[3 * f], tail[3 * f + 1], tail[3 * f + 2]
    e0, e1, e2 = subtract(row(V, c), row(V, b)), subtract(row(V, a), row(V, c)), subtract(row(V, b), row(V, a))
    q0, q1, q2 = dot(e0, e0), dot(e1, e1), dot(e2, e2)
    real = _real_area(tail, f, V)
    third = (q0 + q1 + q2) / 3.0
    if third > 1e-28:
        quality = 4.0 / np.sqrt(3.0) * real / third
        pull = max(1.0 - min(quality / source.sliver, 1.0), 1.0 - source.trust)
        q0, q1, q2 = q0 + pull * (third - q0), q1 + pull * (third - q1), q2 + pull * (third - q2)
    else:
        q0 = q1 = q2 = 1.0
    area = max(real * (source.load[a] + source.load[b] + source.load[c]) / 3.0, SMALLEST_SHARE * source.mean)
    if source.trust < 1.0:
        area = area**source.trust * source.mean ** (1.0 - source.trust)
    four_areas = np.sqrt(max(2.0 * (q0 * q1 + q1 * q2 + q2 * q0) - (q0 * q0 + q1 * q1 + q2 * q2), 1e-300))
    scale = 0.5 / (four_areas * area)
    reference.area[f] = area
    reference.cotangent[3 * f] = scale * (q1 + q2 - q0)
    reference.cotangent[3 * f + 1] = scale * (q2 + q0 - q1)
    reference.cotangent[3 * f + 2] = scale * (q0 + q1 - q2)


@kernel
def update_level(vertices: Ints32, triangles: Ints32, table: CornerTable, source: Source, reference: Reference) -> None:
    """Set the references of a whole level, their areas summing to the sphere's 4 pi."""
    star = np.empty(len(source.V), np.int32)
    for v in vertices:
        update_load(v, star, gather_star(table, v, star), table.tail, source)
    total = 0.0
    for f in triangles:
        update_triangle(f, table.tail, source, reference)
        total += reference.area[f]
    scale = 4.0 * np.pi / total
    for f in triangles:
        reference.area[f] *= scale
        for h in range(3 * f, 3 * f + 3):
            reference.cotangent[h] /= scale
