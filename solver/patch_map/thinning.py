"""Fewer and fewer vertices: rounds of half-edge collapses that keep a seamless map free of folds.

In each round the cheapest collapses are done, none of two neighbours, so that all are judged on the same mesh. Prices
are those of the sphere map's decimation. A collapse must meet the link condition, keep the rim where it is, and turn no
triangle over on the charts. Fixed vertices stay, and none is merged with one that has more than a full turn round it:
from there a vertex might not find back, for no place sees all round such a cone.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel
from ripple_sim.solver.sphere_map.quadrics import quadric_error, vertex_quadrics
from ripple_sim.solver.sphere_map.vectors import dot, row, subtract

from .frames import after, inverse, turned
from .seamless import FIXED, FREE, SeamlessMap, corner_place, corner_places, frame_of, stars

_ROUND_SHARE = 0.2  # of the vertices left, removed in one round
_LEAST_SHARE = 0.01
_DEGREE_LIMIT, _COMFORTABLE_DEGREE = 12, 8
_FLATTEST = 1e-3  # area over squared length of a triangle on the charts after a collapse
_COARSEST = 3  # vertices left, for each that is fixed


class Round(NamedTuple):
    """The triangles of one round, and how they see their corners: frames are those of the map that was thinned out."""

    F: Ints  # [m, 3]
    turn: Ints  # [m, 3]
    shift: Ints  # [m, 3, 2]
    vertices: int  # how many: the first ones


def thinned(seamless: SeamlessMap, V: Floats) -> tuple[list[Round], NDArray[np.int64], NDArray[np.int64]]:
    """Remove vertices in rounds.

    Returns
    -------
    list of Round
        From all vertices to the fewest, which come first.
    order : int64 [n]
        The vertex of the map that each number of the rounds stands for.
    kept : int64 [n]
        With which vertex each one was merged.
    """
    n = len(V)
    edges = V[seamless.F] - V[np.roll(seamless.F, -1, axis=1)]
    blur = 1e-4 * float((edges**2).sum(axis=2).mean())
    quadrics = vertex_quadrics(np.ascontiguousarray(seamless.F.ravel(), np.int32), V)
    merged = np.arange(n)
    wide = _total_angles(seamless) > 1.1 * 2 * np.pi
    gone, alive, rounds = np.full(n, -1), n, []
    enough = _COARSEST * int((seamless.freedom == FIXED).sum()) + 20
    current = seamless
    while True:
        rounds.append(Round(current.F, current.turn, current.shift, alive))
        cost, target = _prices(current, V, quadrics, blur, wide)
        quota = min(int(_ROUND_SHARE * alive) + 1, alive - enough)
        chosen = _chosen(current, np.argsort(cost, kind="stable"), cost, target, quota)
        count = int(chosen.sum())
        if quota <= 0 or count < _LEAST_SHARE * alive:
            break
        removed = np.flatnonzero(chosen)
        gone[removed] = len(rounds)
        into = _targets(current.F, removed, target[removed])
        merged[removed] = into
        np.add.at(quadrics, into, quadrics[removed])
        F, turn, shift, frame, size = _collapsed(current, chosen, target)
        alive -= count
        start, star = stars(F[:size], n)
        current = current._replace(
            F=F[:size], turn=turn[:size], shift=shift[:size], frame=frame[:size], star_start=start, star=star
        )
    last = len(rounds)
    # the first ones are those that stay longest
    order = np.argsort(np.where(gone < 0, 0, last - gone + 1), kind="stable")
    number = np.empty(n, np.int64)
    number[order] = np.arange(n)
    return [each._replace(F=number[each.F]) for each in rounds], order, number[merged][order]


def _total_angles(seamless: SeamlessMap) -> NDArray[np.float64]:
    """Angle round each vertex on the charts [n]."""
    places = corner_places(seamless)
    total = np.zeros(len(seamless.x))
    for k in range(3):
        u, v = places[:, (k + 1) % 3] - places[:, k], places[:, (k + 2) % 3] - places[:, k]
        angle = np.arctan2(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0], (u * v).sum(axis=1))
        total += np.bincount(seamless.F[:, k], angle, len(total))
    return total


def _targets(F: Ints, vertices: Ints, sides: Ints) -> Ints:
    """The other ends of sides 3 triangle + k."""
    triangle, k = np.divmod(sides, 3)
    first, second = F[triangle, k], F[triangle, (k + 1) % 3]
    return np.where(first == vertices, second, first)


@kernel
def _prices(seamless: SeamlessMap, V: Floats, quadrics: Floats, blur: float, wide: Bools) -> tuple[Floats, Ints]:
    """Price of the cheapest collapse of each vertex, and a side 3 triangle + k from it to its target, or back."""
    n = len(V)
    cost, target = np.full(n, np.inf), np.full(n, -1)
    seen = np.full(n, -1)
    for u in range(n):
        first, last = seamless.star_start[u], seamless.star_start[u + 1]
        degree = last - first
        if seamless.freedom[u] == FIXED or degree == 0 or degree > _DEGREE_LIMIT:
            continue
        anchored = False
        for i in range(first, last):
            f, k = seamless.star[i] // 3, seamless.star[i] % 3
            for j in (1, 2):
                w = seamless.F[f, (k + j) % 3]
                seen[w] = u
                anchored = anchored or seamless.freedom[w] != FIXED
        if not anchored:
            continue
        for i in range(first, last):
            for j in (1, 2):
                if wide[seamless.F[seamless.star[i] // 3, (seamless.star[i] % 3 + j) % 3]]:
                    continue
                price = _price(seamless, V, quadrics, blur, u, seamless.star[i], j, seen)
                if price < cost[u]:
                    cost[u] = price
                    f, k = seamless.star[i] // 3, seamless.star[i] % 3
                    target[u] = 3 * f + (k if j == 1 else (k + 2) % 3)
    return cost, target


@kernel
def _price(
    seamless: SeamlessMap, V: Floats, quadrics: Floats, blur: float, u: int, h: int, j: int, seen: Ints
) -> float:
    """Price of merging u into the next corner (j = 1) of one of its triangles, or the one before (j = 2)."""
    f, k = h // 3, h % 3
    v = seamless.F[f, (k + j) % 3]
    p = row(V, v)
    to_u = inverse(frame_of(seamless, f, k))
    vx, vy = corner_place(seamless, f, (k + j) % 3)
    vx, vy = turned(vx, vy, to_u[0])
    vx, vy = vx + to_u[1], vy + to_u[2]
    beside, span, flattest = 0, 0.0, np.inf
    for i in range(seamless.star_start[u], seamless.star_start[u + 1]):
        g, m = seamless.star[i] // 3, seamless.star[i] % 3
        a, b = seamless.F[g, (m + 1) % 3], seamless.F[g, (m + 2) % 3]
        for w in (a, b):
            e = subtract(row(V, w), p)
            span = max(span, dot(e, e))
        if a == v or b == v:
            beside += 1
            continue
        to_u = inverse(frame_of(seamless, g, m))
        ax, ay = corner_place(seamless, g, (m + 1) % 3)
        bx, by = corner_place(seamless, g, (m + 2) % 3)
        ax, ay = turned(ax, ay, to_u[0])
        bx, by = turned(bx, by, to_u[0])
        ax, ay, bx, by = ax + to_u[1] - vx, ay + to_u[2] - vy, bx + to_u[1] - vx, by + to_u[2] - vy
        longest = max(ax * ax + ay * ay, bx * bx + by * by, (ax - bx) ** 2 + (ay - by) ** 2)
        flattest = min(flattest, (ax * by - ay * bx) / longest)
    interior = seamless.freedom[u] == FREE
    if not flattest > _FLATTEST or beside != (2 if interior else 1):
        return np.inf
    common, degree = _meeting(seamless, u, v, seen)
    if common != beside:
        return np.inf
    merged = seamless.star_start[u + 1] - seamless.star_start[u] + degree - 2 * beside
    if merged > _DEGREE_LIMIT and seamless.freedom[v] != FIXED:
        return np.inf
    e = subtract(row(V, u), p)
    shape = (span + blur) * (dot(e, e) + blur) * (1.0 + 0.5 * max(merged - _COMFORTABLE_DEGREE, 0))
    return shape + max(quadric_error(quadrics[u], p[0], p[1], p[2]), 0.0)


@kernel
def _meeting(seamless: SeamlessMap, u: int, v: int, seen: Ints) -> tuple[int, int]:
    """How many neighbours v shares with u, whose are marked in `seen`, and how many triangles it has."""
    common = 0
    first, last = seamless.star_start[v], seamless.star_start[v + 1]
    for i in range(first, last):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        for j in (1, 2):
            w = seamless.F[f, (k + j) % 3]
            if seen[w] == u:  # each once
                seen[w] = -2 - u
                common += 1
    for i in range(first, last):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        for j in (1, 2):
            w = seamless.F[f, (k + j) % 3]
            if seen[w] == -2 - u:
                seen[w] = u
    return common, last - first


@kernel
def _chosen(seamless: SeamlessMap, order: Ints, cost: Floats, target: Ints, quota: int) -> Bools:
    """The cheapest collapses, none of two neighbours, and none that make the same edge."""
    n = len(order)
    chosen, blocked, made = np.zeros(n, np.bool_), np.zeros(n, np.bool_), {np.int64(-1)}
    done = 0
    for u in order:
        if done >= quota or not cost[u] < np.inf:
            break
        if blocked[u]:
            continue
        f, k = target[u] // 3, target[u] % 3
        v = seamless.F[f, k] if seamless.F[f, k] != u else seamless.F[f, (k + 1) % 3]
        first, last = seamless.star_start[u], seamless.star_start[u + 1]
        free = True
        for i in range(first, last):
            f, k = seamless.star[i] // 3, seamless.star[i] % 3
            for j in (1, 2):
                w = seamless.F[f, (k + j) % 3]
                free = free and (min(v, w) * n + max(v, w)) not in made
        if not free:
            continue
        for i in range(first, last):
            f, k = seamless.star[i] // 3, seamless.star[i] % 3
            for j in (1, 2):
                w = seamless.F[f, (k + j) % 3]
                blocked[w] = True
                made.add(min(v, w) * n + max(v, w))
        chosen[u] = True
        done += 1
    return chosen


@kernel
def _collapsed(seamless: SeamlessMap, chosen: Bools, target: Ints) -> tuple[Ints, Ints, Ints, Ints, int]:
    """The triangles that are left, and how many."""
    F, turn, shift, frame = seamless.F.copy(), seamless.turn.copy(), seamless.shift.copy(), seamless.frame.copy()
    size = 0
    for f in range(len(F)):
        k = 0
        while k < 3 and not chosen[seamless.F[f, k]]:
            k += 1
        F[size], turn[size], shift[size] = seamless.F[f], seamless.turn[f], seamless.shift[f]
        frame[size] = seamless.frame[f]
        if k < 3:
            u = seamless.F[f, k]
            # in a triangle with u and v, how u and v are seen
            g, m = target[u] // 3, target[u] % 3
            at_u, at_v = (m, (m + 1) % 3) if seamless.F[g, m] == u else ((m + 1) % 3, m)
            v = seamless.F[g, at_v]
            if v == seamless.F[f, 0] or v == seamless.F[f, 1] or v == seamless.F[f, 2]:
                continue
            through_u = after(inverse(frame_of(seamless, g, at_u)), frame_of(seamless, f, k))
            change = after(frame_of(seamless, g, at_v), through_u)
            F[size, k], turn[size, k], shift[size, k, 0], shift[size, k, 1] = v, change[0], change[1], change[2]
        size += 1
    return F, turn, shift, frame, size
