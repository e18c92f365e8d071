"""Half-edge collapses from the full mesh down to a tetrahedron.

Collapses go in rounds: the cheapest ones first, none beside another of the same round, so that a round needs no
priority queue and every cost in it is up to date. The cost favours short edges and compact triangles, plus the quadric
error of Garland and Heckbert (1997), which keeps limbs for as long as possible. A collapse must meet the link
condition: its two vertices have exactly two neighbours in common. Then the mesh stays a triangulated sphere.
"""

from __future__ import annotations

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints32, kernel

from .corner_table import CornerTable, collapse, following, gather_star, preceding
from .vectors import cross, dot, row, set_row, subtract

ROUND_SHARE = 0.15  # of the vertices left, removed in one round
COMFORTABLE_DEGREE = 8
DEGREE_LIMIT = 12  # of a merged vertex, raised where nothing else is left to collapse


def decimate(table: CornerTable, V: Floats) -> Ints32:
    """Collapse `table` to a tetrahedron in place and return the half-edges collapsed, in order, shape [n - 4]."""
    edges = V[table.tail] - V[table.tail[table.twin]]
    blur = 1e-4 * float(np.mean(np.sum(edges * edges, axis=1)))
    log = np.empty(len(V) - 4, dtype=np.int32)
    quadrics = _vertex_quadrics(table.tail, V)
    target = np.full(len(V), -1, dtype=np.int32)  # half-edge of the cheapest collapse
    cost = np.full(len(V), np.inf)
    stale = np.ones(len(V), dtype=np.bool_)
    merged = np.ones(len(V))
    degree = np.bincount(table.tail, minlength=len(V)).astype(np.int32)
    alive = np.arange(len(V), dtype=np.int32)
    done, limit = 0, DEGREE_LIMIT
    while done < len(log):
        _price(alive, table, V, quadrics, merged, degree, blur, limit, stale, cost, target)
        order = alive[np.argsort(cost[alive], kind="stable")]
        quota = min(len(log) - done, max(1, int(ROUND_SHARE * len(alive))))
        removed = _collapse_round(order, quota, table, quadrics, merged, degree, limit, cost, target, stale, log[done:])
        if removed == 0:
            limit *= 2
            stale[alive] = True
        done += removed
        alive = alive[cost[alive] >= 0.0]
    return log


@kernel
def _vertex_quadrics(tail: Ints32, V: Floats) -> Floats:
    """Area-weighted sums of squared plane distances: xx xy xz yy yz zz, x y z, 1 of each vertex, shape [n, 10]."""
    quadrics = np.zeros((len(V), 10))
    for f in range(len(tail) // 3):
        p = row(V, tail[3 * f])
        normal = cross(subtract(row(V, tail[3 * f + 1]), p), subtract(row(V, tail[3 * f + 2]), p))
        twice_area = np.sqrt(dot(normal, normal))
        if twice_area > 0.0:
            x, y, z = normal[0] / twice_area, normal[1] / twice_area, normal[2] / twice_area
            d = -(x * p[0] + y * p[1] + z * p[2])
            terms = (x * x, x * y, x * z, y * y, y * z, z * z, x * d, y * d, z * d, d * d)
            for j in range(3):
                for i in range(10):
                    quadrics[tail[3 * f + j], i] += 0.5 * twice_area * terms[i]
    return quadrics


@kernel
def _quadric_error(q: Floats, x: float, y: float, z: float) -> float:
    squares = q[0] * x * x + q[3] * y * y + q[5] * z * z + 2.0 * (q[1] * x * y + q[2] * x * z + q[4] * y * z)
    return squares + 2.0 * (q[6] * x + q[7] * y + q[8] * z) + q[9]


@kernel
def _mark_neighbours(table: CornerTable, u: int, mark: Ints32) -> None:
    """Write u beside each of its neighbours."""
    first = h = table.leaving[u]
    while True:
        mark[table.tail[following(h)]] = u
        h = table.twin[preceding(h)]
        if h == first:
            return


@kernel
def _is_legal(table: CornerTable, u: int, v: int, mark: Ints32) -> bool:
    """Tell whether v and u, whose neighbours are marked, meet the link condition."""
    first = h = table.leaving[v]
    common = 0
    while True:
        common += mark[table.tail[following(h)]] == u
        h = table.twin[preceding(h)]
        if h == first:
            return common == 2


@kernel
def _price(
    alive: Ints32,
    table: CornerTable,
    V: Floats,
    quadrics: Floats,
    merged: Floats,
    degree: Ints32,
    blur: float,
    limit: int,
    stale: np.ndarray,
    cost: Floats,
    target: Ints32,
) -> None:
    """Find the cheapest legal collapse of every stale vertex (`blur`: a squared length below which all are alike)."""
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
        _mark_neighbours(table, u, mark)
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
            price = shape + max(_quadric_error(quadrics[u], p[0], p[1], p[2]), 0.0) + blur * blur * merged[u]
            if price < least and _is_legal(table, u, v, mark):
                least, cheapest = price, h
        cost[u], target[u] = least, cheapest


@kernel
def _collapse_round(
    order: Ints32,
    quota: int,
    table: CornerTable,
    quadrics: Floats,
    merged: Floats,
    degree: Ints32,
    limit: int,
    cost: Floats,
    target: Ints32,
    stale: np.ndarray,
    log: Ints32,
) -> int:
    """Collapse up to `quota` vertices in `order`, none beside another; mark removed ones by a negative cost."""
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
        _mark_neighbours(table, u, mark)
        if not _is_legal(table, u, v, mark):
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
