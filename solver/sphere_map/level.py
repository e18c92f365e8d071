"""One level of detail of the mesh, its vertices and triangles renumbered without gaps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .corner_table import CornerTable
from .vectors import Ints


class Level(NamedTuple):
    """Triangles of a level, its edges, and the star of each vertex; h is one of the level's 3 m half-edges."""

    tail: Ints  # [3 m] vertex where a half-edge starts
    edge: Ints  # [3 m] edge that a half-edge lies on
    ends: Ints  # [e, 2] vertices of an edge; the half-edge that starts at the first one is the lower-numbered
    star_start: Ints  # [n + 1] where a vertex's half-edges begin in `star`
    star: Ints  # [3 m] half-edges sorted by tail


def build_level(table: CornerTable, vertices: NDArray[np.integer], faces: NDArray[np.integer]) -> Level:
    """Level made of the given vertices and triangles of a (partly collapsed) corner table."""
    corners = (3 * faces[:, None] + np.arange(3)).ravel()
    tail = _renumber(vertices, len(table.leaving))[table.tail[corners]]
    twin = _renumber(corners, len(table.tail))[table.twin[corners]]
    lower = np.flatnonzero(np.arange(len(twin)) < twin)
    edge = np.empty(len(twin), dtype=np.int32)
    edge[lower] = edge[twin[lower]] = np.arange(len(lower))
    ends = np.stack([tail[lower], tail[twin[lower]]], axis=1)
    star = np.argsort(tail, kind="stable").astype(np.int32)
    star_start = np.concatenate([[0], np.cumsum(np.bincount(tail))]).astype(np.int32)
    return Level(tail, edge, ends, star_start, star)


def _renumber(kept: NDArray[np.integer], count: int) -> Ints:
    number = np.full(count, -1, dtype=np.int32)
    number[kept] = np.arange(len(kept))
    return number
