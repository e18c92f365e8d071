"""Half-edge collapses from the full mesh down to a tetrahedron.

Collapses go in rounds: the cheapest ones first, none beside another of the same round, so that a
round needs no priority queue and every cost in it is up to date. The cost favours short edges and
compact triangles, plus the quadric error of Garland and Heckbert (1997), which keeps limbs for as
long as possible. A collapse must meet the link condition: its two vertices have exactly two
neighbours in common. Then the mesh stays a triangulated sphere.

Half-edge h = 3 f + j is side j of triangle f and starts at vertex `tail[h]`; `twin[h]` is the same
side seen from the neighbouring triangle; `leaving[v]` is any half-edge that starts at v. A
half-edge is also the triangle's corner at its tail. A collapse leaves the two triangles it removes
as they were, twins included. These stale links are all that its undoing needs (Knuth's dancing
links), so a log of collapses is a list of half-edges.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Bools, Floats, Ints32, kernel, shared
from ...mesh.vectors import cross, dot, row, subtract

ROUND_SHARE = 0.15  # of the vertices left, removed in one round
COMFORTABLE_DEGREE = 8
DEGREE_LIMIT = 12  # of a merged vertex, raised where nothing else is left to collapse


class CornerTable(NamedTuple):
    """Half-edges of a closed triangle mesh."""

    tail: Ints32  # [3 m]
    twin: Ints32  # [3 m]
    leaving: Ints32  # [n]


def corner_table(F: NDArray[np.integer], vertex_count: int) -> CornerTable:
    """Half-edges of the closed, consistently oriented triangles F, shape [m, 3]."""
    tail = np.ascontiguousarray(F, dtype=np.int32).ravel()
    head = np.roll(F, -1, axis=1).ravel()
    low = np.minimum(tail, head).astype(np.int64)
    high = np.maximum(tail, head)
    pairs = np.argsort(low * vertex_count + high, kind="stable").reshape(-1, 2)
    twin = np.empty(len(tail), dtype=np.int32)
    twin[pairs[:, 0]] = pairs[:, 1]
    twin[pairs[:, 1]] = pairs[:, 0]
    leaving = np.empty(vertex_count, dtype=np.int32)
    leaving[tail] = np.arange(len(tail))
    return CornerTable(tail, twin, leaving)


@shared
def following(h: Any) -> Any:
    """Next half-edge round the triangle; of one half-edge, or of an array of them."""
    return h - h % 3 + (h + 1) % 3


@shared
def preceding(h: Any) -> Any:
    """Previous half-edge round the triangle; of one half-edge, or of an array of them."""
    return h - h % 3 + (h + 2) % 3


@kernel
def gather_star(table: CornerTable, v: int, star: Ints32) -> int:
    """Fill `star` with the half-edges that leave v, counterclockwise; return how many there are."""
    first = h = table.leaving[v]
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
    left_in = twin[following(h)]
    left_out = twin[preceding(h)]
    right_in = twin[following(t)]
    right_out = twin[preceding(t)]
    g = left_out
    while g != following(t):
        tail[g] = v
        g = twin[preceding(g)]
    twin[left_in] = left_out
    twin[left_out] = left_in
    twin[right_in] = right_out
    twin[right_out] = right_in
    leaving[v] = left_out
    leaving[tail[left_in]] = left_in
    leaving[tail[right_in]] = right_in


@kernel
def undo_collapse(table: CornerTable, h: int) -> None:
    """Bring back the tail of h and the two triangles beside h.

    Only the latest collapse can be undone.
    """
    tail, twin, leaving = table
    t = twin[h]
    u = tail[h]
    for g in (following(h), preceding(h), following(t), preceding(t)):
        twin[twin[g]] = g
    g = twin[preceding(h)]
    while g != following(t):
        tail[g] = u
        g = twin[preceding(g)]
    leaving[u] = h
    leaving[tail[t]] = t


@kernel
def is_collapsible(table: CornerTable, u: int, v: int, mark: Ints32) -> bool:
    """Tell whether v and u, beside whose neighbours `mark` [n] has u, meet the link condition."""
    first = h = table.leaving[v]
    common = 0
    while True:
        common += mark[table.tail[following(h)]] == u
        h = table.twin[preceding(h)]
        if h == first:
            return common == 2


def vertex_quadrics(tail: Ints32, V: Floats) -> Floats:
    """Quadrics of the vertices: how far a point is from the planes of the triangles round each.

    Area-weighted sums of squared distances (Garland and Heckbert 1997): xx xy xz yy yz zz, x y z,
    1, shape [n, 10].
    """
    p, q, r = (V[tail[k::3]].T for k in range(3))
    normal = cross(subtract(q, p), subtract(r, p))
    twice_area = np.sqrt(dot(normal, normal))
    with np.errstate(invalid="ignore", divide="ignore"):
        x, y, z = (np.where(twice_area > 0.0, each / twice_area, 0.0) for each in normal)
    d = -dot((x, y, z), p)
    terms = (x * x, x * y, x * z, y * y, y * z, z * z, x * d, y * d, z * d, d * d)
    return np.stack(
        [np.bincount(tail, np.repeat(0.5 * twice_area * each, 3), len(V)) for each in terms], axis=1
    )


class _Front(NamedTuple):
    """The mesh while it collapses, and the next collapse of each vertex as far as it is known."""

    table: CornerTable
    V: Floats  # [n, 3]
    quadrics: Floats  # [n, 10]
    merged: Floats  # [n] how many vertices each has taken in, itself included
    degree: Ints32  # [n]
    stale: Bools  # [n] whose price is to be found again
    cost: Floats  # [n] price of the cheapest collapse; negative once the vertex is gone
    target: Ints32  # [n] half-edge of the cheapest collapse


def decimate(table: CornerTable, V: Floats) -> Ints32:
    """Collapse `table` to a tetrahedron in place.

    Returns the collapsed half-edges in order, [n - 4].
    """
    edges = V[table.tail] - V[table.tail[table.twin]]
    blur = 1e-4 * float(np.mean(np.sum(edges * edges, axis=1)))
    n = len(V)
    log = np.empty(n - 4, np.int32)
    alive = np.arange(n, dtype=np.int32)
    degree = np.bincount(table.tail, minlength=n).astype(np.int32)
    stale = np.ones(n, np.bool_)
    cost = np.full(n, np.inf)
    target = np.full(n, -1, np.int32)
    front = _Front(
        table, V, vertex_quadrics(table.tail, V), np.ones(n), degree, stale, cost, target
    )
    done = 0
    limit = DEGREE_LIMIT
    while done < len(log):
        _price(alive, front, blur, limit)
        order = alive[np.argsort(cost[alive], kind="stable")]
        quota = min(len(log) - done, max(1, int(ROUND_SHARE * len(alive))))
        removed = _collapse_round(order, quota, front, limit, log[done:])
        if removed == 0:
            limit *= 2
            stale[alive] = True
        done += removed
        alive = alive[cost[alive] >= 0.0]
    return log


@kernel
def _price(alive: Ints32, front: _Front, blur: float, limit: int) -> None:
    """Find the cheapest legal collapse of every stale vertex.

    Squared lengths below `blur` count as equal.
    """
    table, V, quadrics, merged, degree, stale, cost, target = front
    neighbours = np.empty(len(V), np.int32)
    mark = np.full(len(V), -1, np.int32)
    ring = np.empty((len(V), 3))
    for u in alive:
        if not stale[u]:
            continue
        stale[u] = False
        cost[u] = np.inf
        if degree[u] > limit + 1:
            continue
        gather_star(table, u, neighbours)
        position = row(V, u)
        size = degree[u]
        for i in range(size):
            v = table.tail[following(neighbours[i])]
            ring[i, 0], ring[i, 1], ring[i, 2] = row(V, v)
            mark[v] = u
        least = np.inf
        cheapest = -1
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
            shape = (
                (span + blur)
                * (dot(e, e) + blur)
                * (1.0 + 0.5 * max(merged_degree - COMFORTABLE_DEGREE, 0))
            )
            q = quadrics[u]
            (x, y, z) = p
            error = (
                q[0] * x * x
                + q[3] * y * y
                + q[5] * z * z
                + 2.0 * (q[1] * x * y + q[2] * x * z + q[4] * y * z)
            )
            error = error + 2.0 * (q[6] * x + q[7] * y + q[8] * z) + q[9]
            price = shape + max(error, 0.0) + blur * blur * merged[u]
            if price < least and is_collapsible(table, u, v, mark):
                least = price
                cheapest = h
        cost[u] = least
        target[u] = cheapest


@kernel
def _collapse_round(order: Ints32, quota: int, front: _Front, limit: int, log: Ints32) -> int:
    """Collapse up to `quota` vertices in `order`, none of them beside another.

    A negative cost marks the vertices that are removed.
    """
    table, _, quadrics, merged, degree, stale, cost, target = front
    star = np.empty(len(cost), np.int32)
    mark = np.full(len(cost), -1, np.int32)
    done = 0
    for u in order:
        if done == quota or cost[u] == np.inf:
            break
        h = target[u]
        v = table.tail[following(h)]
        if stale[u] or degree[u] + degree[v] - 4 > limit:
            stale[u] = True
            continue
        size = gather_star(table, u, star)
        for i in range(size):
            mark[table.tail[following(star[i])]] = u
        if not is_collapsible(table, u, v, mark):
            stale[u] = True
            continue
        for i in range(size):
            stale[table.tail[following(star[i])]] = True
        degree[v] += degree[u] - 4
        degree[table.tail[preceding(h)]] -= 1
        degree[table.tail[preceding(table.twin[h])]] -= 1
        collapse(table, h)
        for k in range(quadrics.shape[1]):  # slices would take longer to compile
            quadrics[v, k] += quadrics[u, k]
        merged[v] += merged[u]
        cost[u] = -1.0
        log[done] = h
        done += 1
    return done
