"""Half-edge collapses from the full mesh down to a tetrahedron.

Collapses go in rounds: the cheapest ones first, none beside another of the same round, so that a round needs no
priority queue and every cost in it is up to date. The cost favours short edges and compact triangles, plus the quadric
error of Garland and Heckbert (1997), which keeps limbs for as long as possible. A collapse must meet the link
condition: its two vertices have exactly two neighbours in common. Then the mesh stays a triangulated sphere.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Bools, Floats, Ints32, kernel
from .corner_table import CornerTable, collapse, following, gather_star, is_collapsible, mark_neighbours, preceding
from .quadrics import quadric_error, vertex_quadrics
from .vectors import dot, row, set_row, subtract

ROUND_SHARE = 0.15  # of the vertices left, removed in one round
COMFORTABLE_DEGREE = 8
DEGREE_LIMIT = 12  # of a merged vertex, raised where nothing else is left to collapse


class _Front(NamedTuple):
    """The mesh while it collapses, and what is known of the next collapse of each vertex."""

    table: CornerTable
    V: Floats  # [n, 3]
    quadrics: Floats  # [n, 10]
    merged: Floats  # [n] how many vertices each has taken in, itself included
    degree: Ints32  # [n]
    stale: Bools  # [n] whose price is to be found again
    cost: Floats  # [n] price of the cheapest collapse; negative once the vertex is gone
    target: Ints32  # [n] half-edge of the cheapest collapse


def decimate(table: CornerTable, V: Floats) -> Ints32:
    """Collapse `table` to a tetrahedron in place and return the half-edges collapsed, in order, shape [n - 4]."""
    edges = V[table.tail] - V[table.tail[table.twin]]
    blur = 1e-4 * float(np.mean(np.sum(edges * edges, axis=1)))
    n = len(V)
    log = np.empty(n - 4, dtype=np.int32)
    front = _Front(
        table,
        V,
        vertex_quadrics(table.tail, V),
        merged=np.ones(n),
        degree=np.bincount(table.tail, minlength=n).astype(np.int32),
        stale=np.ones(n, dtype=np.bool_),
        cost=np.full(n, np.inf),
        target=np.full(n, -1, dtype=np.int32),
    )
    alive = np.arange(n, dtype=np.int32)
    done, limit = 0, DEGREE_LIMIT
    while done < len(log):
        _price(alive, front, blur, limit)
        order = alive[np.argsort(front.cost[alive], kind="stable")]
        quota = min(len(log) - done, max(1, int(ROUND_SHARE * len(alive))))
        removed = _collapse_round(order, quota, front, limit, log[done:])
        if removed == 0:
            limit *= 2
            front.stale[alive] = True
        done += removed
        alive = alive[front.cost[alive] >= 0.0]
    return log


@kernel
def _price(alive: Ints32, front: _Front, blur: float, limit: int) -> None:
    """Find the cheapest legal collapse of every stale vertex (`blur`: a squared length below which all are alike)."""
    table, V, quadrics, merged, degree, stale, cost, target = front
    neighbours, mark = np.empty(len(V), np.int32), np.full(len(V), -1, np.int32)
    ring = np.empty((len(V), 3))
    for u in alive:
        if not stale[u]:
            continue
        stale[u] = False
        cost[u] = np.inf
        if degree[u] > limit + 1:
            continue
        gather_star(table, u, neighbours)
        mark_neighbours(table, u, mark)
        position, size = row(V, u), degree[u]
        for i in range(size):
            set_row(ring, i, row(V, table.tail[following(neighbours[i])]))
        least, cheapest = np.inf, -1
        for i in range(size):
            h = neighbours[i]
            v = table.tail[following(h)]
            merged_degree = size + degree[v] - 4
            if merged_degree > limit:
                continue
            p = row(ring, i)
            span = 0.0
            for j in range(size):
                e = subtract(row(ring, j), p)
                span = max(span, dot(e, e))
            e = subtract(position, p)
            shape = (span + blur) * (dot(e, e) + blur) * (1.0 + 0.5 * max(merged_degree - COMFORTABLE_DEGREE, 0))
            price = shape + max(quadric_error(quadrics[u], p[0], p[1], p[2]), 0.0) + blur * blur * merged[u]
            if price < least and is_collapsible(table, u, v, mark):
                least, cheapest = price, h
        cost[u], target[u] = least, cheapest


@kernel
def _collapse_round(order: Ints32, quota: int, front: _Front, limit: int, log: Ints32) -> int:
    """Collapse up to `quota` vertices in `order`, none beside another; mark removed ones by a negative cost."""
    table, _, quadrics, merged, degree, stale, cost, target = front
    star, mark = np.empty(len(cost), np.int32), np.full(len(cost), -1, np.int32)
    done = 0
    for u in order:
        if done == quota or cost[u] == np.inf:
            break
        h = target[u]
        v = table.tail[following(h)]
        if stale[u] or degree[u] + degree[v] - 4 > limit:
            stale[u] = True
            continue
        mark_neighbours(table, u, mark)
        if not is_collapsible(table, u, v, mark):
            stale[u] = True
            continue
        for i in range(gather_star(table, u, star)):
            stale[table.tail[following(star[i])]] = True
        degree[v] += degree[u] - 4
        degree[table.tail[preceding(h)]] -= 1
        degree[table.tail[preceding(table.twin[h])]] -= 1
        collapse(table, h)
        quadrics[v] += quadrics[u]
        merged[v] += merged[u]
        cost[u] = -1.0
        log[done] = h
        done += 1
    return done
