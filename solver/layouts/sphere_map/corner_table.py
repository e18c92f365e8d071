"""A triangle mesh as half-edges three to a triangle, with collapses that can be undone in reverse order.

Half-edge h = 3 f + j is side j of triangle f and starts at vertex `tail[h]`; `twin[h]` is the same side seen from the
neighbouring triangle; `leaving[v]` is any half-edge that starts at v. A half-edge is also the triangle's corner at its
tail. A collapse leaves the two triangles it removes as they were, twins included. These stale links are all that its
undoing needs (Knuth's dancing links), so a log of collapses is a list of half-edges.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Ints32, kernel


class CornerTable(NamedTuple):
    """Half-edges of a closed triangle mesh."""

    tail: Ints32  # [3 m]
    twin: Ints32  # [3 m]
    leaving: Ints32  # [n]


def corner_table(F: NDArray[np.integer], vertex_count: int) -> CornerTable:
    """Half-edges of the closed, consistently oriented triangles F, shape [m, 3]."""
    tail = np.ascontiguousarray(F, dtype=np.int32).ravel()
    head = np.roll(F, -1, axis=1).ravel()
    low, high = np.minimum(tail, head).astype(np.int64), np.maximum(tail, head)
    pairs = np.argsort(low * vertex_count + high, kind="stable").reshape(-1, 2)
    twin = np.empty(len(tail), dtype=np.int32)
    twin[pairs[:, 0]], twin[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
    leaving = np.empty(vertex_count, dtype=np.int32)
    leaving[tail] = np.arange(len(tail))
    return CornerTable(tail, twin, leaving)


@kernel
def following(h: int) -> int:
    """Next half-edge round the triangle."""
    return h + 1 if h % 3 < 2 else h - 2


@kernel
def preceding(h: int) -> int:
    """Previous half-edge round the triangle."""
    return h - 1 if h % 3 > 0 else h + 2


@kernel
def gather_star(table: CornerTable, v: int, star: Ints32) -> int:
    """Fill `star` with the half-edges that leave v, counterclockwise, and return how many there are."""
    first = table.leaving[v]
    h = first
    degree = 0
    while True:
        star[degree] = h
        degree += 1
        h = table.twin[preceding(h)]
        if h == first:
            return degree


@kernel
def collapse(table: CornerTable, h: int) -> None:
    """Merge the tail of h into its head; the triangles on both sides of h vanish."""
    tail, twin, leaving = table
    t = twin[h]
    v = tail[t]
    left_in, left_out = twin[following(h)], twin[preceding(h)]
    right_in, right_out = twin[following(t)], twin[preceding(t)]
    g = left_out
    while g != following(t):
        tail[g] = v
        g = twin[preceding(g)]
    twin[left_in], twin[left_out] = left_out, left_in
    twin[right_in], twin[right_out] = right_out, right_in
    leaving[v], leaving[tail[left_in]], leaving[tail[right_in]] = left_out, left_in, right_in


@kernel
def undo_collapse(table: CornerTable, h: int) -> None:
    """Bring back the tail of h and the two triangles beside h; only the latest collapse can be undone."""
    tail, twin, leaving = table
    t = twin[h]
    u = tail[h]
    for g in (following(h), preceding(h), following(t), preceding(t)):
        twin[twin[g]] = g
    g = twin[preceding(h)]
    while g != following(t):
        tail[g] = u
        g = twin[preceding(g)]
    leaving[u], leaving[tail[t]] = h, t


@kernel
def mark_neighbours(table: CornerTable, u: int, mark: Ints32) -> None:
    """Write u beside each of its neighbours."""
    first = h = table.leaving[u]
    while True:
        mark[table.tail[following(h)]] = u
        h = table.twin[preceding(h)]
        if h == first:
            return


@kernel
def is_collapsible(table: CornerTable, u: int, v: int, mark: Ints32) -> bool:
    """Tell whether v and u, whose neighbours are marked, meet the link condition."""
    first = h = table.leaving[v]
    common = 0
    while True:
        common += mark[table.tail[following(h)]] == u
        h = table.twin[preceding(h)]
        if h == first:
            return common == 2
