"""One level of detail of the mesh, its vertices and triangles renumbered without gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Floats, Ints32, kernel
from .corner_table import CornerTable, following, gather_star, preceding
from .energy import Reference


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
