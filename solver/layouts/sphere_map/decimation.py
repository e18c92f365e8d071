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
from ...mesh.vectors import Vector, cross, dot, row, subtract

# Share of the remaining vertices that one round removes.
_ROUND_SHARE = 0.15

# Degree of a merged vertex, at most; the limit is raised where nothing else is left to collapse.
_MAX_DEGREE = 12

# Degree beyond which a collapse costs half as much again for each further neighbour.
_COMFORTABLE_DEGREE = 8
_COST_OF_A_DEGREE = 0.5

# Squared lengths below this share of the mean squared edge count as equal.
_MIN_SQUARED_LENGTH = 1e-4

# Vertices of a tetrahedron.
_LAST_VERTICES = 4


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
    """Whether u and v meet the link condition; `mark` [n] has u at all neighbours of u."""
    first = h = table.leaving[v]
    common = 0
    while True:
        if mark[table.tail[following(h)]] == u:
            common += 1
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
        x, y, z = (np.where(twice_area > 0.0, along / twice_area, 0.0) for along in normal)
    # the triangle's plane is x X + y Y + z Z + d = 0
    d = -dot((x, y, z), p)
    terms = (x * x, x * y, x * z, y * y, y * z, z * z, x * d, y * d, z * d, d * d)
    area = 0.5 * twice_area
    columns = [np.bincount(tail, np.repeat(area * term, 3), len(V)) for term in terms]
    return np.stack(columns, axis=1)


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
    blur = _MIN_SQUARED_LENGTH * float(np.mean(np.sum(edges * edges, axis=1)))
    n = len(V)
    log = np.empty(n - _LAST_VERTICES, np.int32)
    alive = np.arange(n, dtype=np.int32)
    front = _Front(
        table=table,
        V=V,
        quadrics=vertex_quadrics(table.tail, V),
        merged=np.ones(n),
        degree=np.bincount(table.tail, minlength=n).astype(np.int32),
        stale=np.ones(n, np.bool_),
        cost=np.full(n, np.inf),
        target=np.full(n, -1, np.int32),
    )
    collapses = 0
    max_degree = _MAX_DEGREE
    while collapses < len(log):
        _price(alive, front, blur, max_degree)
        order = alive[np.argsort(front.cost[alive], kind="stable")]
        quota = min(len(log) - collapses, max(1, int(_ROUND_SHARE * len(alive))))
        removed = _collapse_round(order, quota, front, max_degree, log[collapses:])
        if removed == 0:
            max_degree *= 2
            front.stale[alive] = True
        collapses += removed
        alive = alive[front.cost[alive] >= 0.0]
    return log


@kernel
def _price(alive: Ints32, front: _Front, blur: float, max_degree: int) -> None:
    """Find the cheapest legal collapse of every stale vertex.

    Squared lengths below `blur` count as equal.
    """
    table = front.table
    V = front.V
    degree = front.degree
    stale = front.stale
    cost = front.cost
    neighbours = np.empty(len(V), np.int32)
    mark = np.full(len(V), -1, np.int32)
    ring = np.empty((len(V), 3))
    for u in alive:
        if not stale[u]:
            continue
        stale[u] = False
        cost[u] = np.inf
        if degree[u] > max_degree + 1:
            continue
        gather_star(table, u, neighbours)
        position = row(V, u)
        size = degree[u]
        for i in range(size):
            v = table.tail[following(neighbours[i])]
            ring[i, 0], ring[i, 1], ring[i, 2] = row(V, v)
            mark[v] = u
        lowest_price = np.inf
        cheapest = -1
        for i in range(size):
            h = neighbours[i]
            v = table.tail[following(h)]
            merged_degree = size + degree[v] - 4
            if merged_degree > max_degree:
                continue
            p = row(ring, i)
            longest_squared = 0.0
            for j in range(size):
                edge = subtract(row(ring, j), p)
                longest_squared = max(longest_squared, dot(edge, edge))
            vanishing_edge = subtract(position, p)
            vanishing_squared = dot(vanishing_edge, vanishing_edge)
            crowding = 1.0 + _COST_OF_A_DEGREE * max(merged_degree - _COMFORTABLE_DEGREE, 0)
            shape = (longest_squared + blur) * (vanishing_squared + blur) * crowding
            error = max(_quadric_error(front.quadrics[u], p), 0.0)
            price = shape + error + blur * blur * front.merged[u]
            if price < lowest_price and is_collapsible(table, u, v, mark):
                lowest_price = price
                cheapest = h
        cost[u] = lowest_price
        front.target[u] = cheapest


@kernel
def _quadric_error(q: Floats, p: Vector) -> float:
    """Quadric [10] at a point; see `vertex_quadrics`."""
    x, y, z = p
    square = (
        q[0] * x * x
        + q[3] * y * y
        + q[5] * z * z
        + 2.0 * (q[1] * x * y + q[2] * x * z + q[4] * y * z)
    )
    return square + 2.0 * (q[6] * x + q[7] * y + q[8] * z) + q[9]


@kernel
def _collapse_round(order: Ints32, quota: int, front: _Front, max_degree: int, log: Ints32) -> int:
    """Collapse up to `quota` vertices in `order`, none of them beside another; return how many.

    The collapsed half-edges are written into the log. A negative cost marks the vertices that are
    removed.
    """
    table = front.table
    quadrics = front.quadrics
    degree = front.degree
    stale = front.stale
    cost = front.cost
    star = np.empty(len(cost), np.int32)
    mark = np.full(len(cost), -1, np.int32)
    collapses = 0
    for u in order:
        if collapses == quota or cost[u] == np.inf:
            break
        h = front.target[u]
        v = table.tail[following(h)]
        if stale[u] or degree[u] + degree[v] - 4 > max_degree:
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
        front.merged[v] += front.merged[u]
        cost[u] = -1.0
        log[collapses] = h
        collapses += 1
    return collapses
