"""Removes vertices that only cuts have made, by half-edge collapses that fold nothing.

Cuts along the borders of cells and charts leave three times as many triangles as there were, most
of them slivers. Once the map knows the charts, the cuts are not needed any more. A half-edge
collapse moves a vertex u onto a neighbour v: the triangles at both disappear, and the other
triangles of u get the corner v.

A collapse must meet the link condition, keep every triangle inside its parent on the mesh, and turn
no triangle over, neither on the mesh nor on the charts. Each round does the best collapses, none of
two neighbours, so that all of them are judged on the same triangles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Bools, Floats, Ints, kernel
from ..energy import FIXED, FREE
from .seamless import (
    Complex,
    SeamlessMap,
    after,
    corner_place,
    frame_of,
    inverse,
    place_seen_from,
    square,
    stars,
    wedge,
)
from .surface import TriangleSurface

# Double area over squared longest side of a triangle on the charts after a collapse, at least.
# Where a triangle is flatter already, such as a piece of a needle, the collapse must make no
# triangle flatter than that one.
_MIN_FLATNESS = 0.02

# Double area of a triangle in its parent, in barycentric coordinates, at least.
_MIN_AREA_IN_PARENT = 1e-9

# Rounds of collapses, at most.
_MAX_ROUNDS = 20

# Share of the vertices in question that a round must remove for another round to follow.
_MIN_COLLAPSED_SHARE = 0.01


class Parents(NamedTuple):
    """Where triangles lie on the mesh."""

    triangle: Ints  # the triangle of the mesh around each, [m]
    inside: Floats  # barycentric coordinates in it of the three corners, [m, 3, 3]


class Collapsed(NamedTuple):
    """The old triangles after some collapses."""

    remains: Bools  # the triangles that are not gone, [m]
    F: Ints  # vertices, [m, 3]
    turn: Ints  # the change of frames at each corner, see `SeamlessMap`, [m, 3]
    shift: Complex  # [m, 3]
    inside: Floats  # see `Parents`, [m, 3, 3]


def without_cuts(
    surface: TriangleSurface, seamless: SeamlessMap, cut: Bools
) -> tuple[TriangleSurface, SeamlessMap]:
    """The same map on fewer triangles: vertices `cut` [n] are gone where that folds nothing."""
    parents = Parents(surface.parent, np.ascontiguousarray(surface.inside))
    count = len(seamless.z)
    worth = np.zeros(count)
    target = np.full(count, -1)
    changed = cut
    for _ in range(_MAX_ROUNDS):
        _find_targets(seamless, parents, cut & changed, surface.at_rim, worth, target)
        chosen = _best_collapses(seamless, np.argsort(-worth, kind="stable"), worth, target)
        if chosen.sum() <= _MIN_COLLAPSED_SHARE * cut.sum():
            break
        collapsed = _collapse(seamless, parents, chosen, target)
        remains = collapsed.remains
        # what a collapse is worth depends on the stars of a vertex and of its neighbours
        changed = _with_neighbours(seamless.F, _with_neighbours(seamless.F, chosen))
        new_number = np.cumsum(remains) - 1
        target = np.where(changed, -1, 3 * new_number[target // 3] + target % 3)
        seamless = _remaining(seamless, collapsed)
        parents = Parents(parents.triangle[remains], collapsed.inside[remains])
    return _without_unused_vertices(surface.V, seamless, parents)


def _remaining(seamless: SeamlessMap, collapsed: Collapsed) -> SeamlessMap:
    """The map on the triangles that remain after collapses, with the old vertices."""
    remains = collapsed.remains
    F = collapsed.F[remains]
    star_start, star = stars(F, len(seamless.z))
    return seamless._replace(
        F=F,
        frame=seamless.frame[remains],
        turn=collapsed.turn[remains],
        shift=collapsed.shift[remains],
        star_start=star_start,
        star=star,
    )


def _without_unused_vertices(
    V: Floats, seamless: SeamlessMap, parents: Parents
) -> tuple[TriangleSurface, SeamlessMap]:
    """The surface and the map of the vertices V [n, 3] [m] that have a triangle."""
    used, F = np.unique(seamless.F, return_inverse=True)
    star_start, star = stars(F, len(used))
    seamless = seamless._replace(
        F=F,
        chart=seamless.chart[used],
        z=seamless.z[used],
        freedom=seamless.freedom[used],
        star_start=star_start,
        star=star,
    )
    return TriangleSurface(V[used], F, parents.triangle, parents.inside), seamless


def _with_neighbours(F: Ints, chosen: Bools) -> Bools:
    """Chosen vertices [n] and all that share one of the triangles F [m, 3] with them."""
    wider = chosen.copy()
    wider[F[chosen[F].any(axis=1)]] = True
    return wider


@kernel
def _find_targets(
    seamless: SeamlessMap,
    parents: Parents,
    candidates: Bools,
    at_rim: Bools,
    worth: Floats,
    target: Ints,
) -> None:
    """Find the best collapse of each candidate [n]: fill in its `worth` and its `target` [n].

    The worth is positive if there is a collapse, and 0 if not. The target is the number 3 f + k of
    a corner k of a triangle f, at the neighbour onto which the vertex moves.
    """
    count = len(seamless.z)
    mark = np.full(count, -1)
    for u in range(count):
        if not candidates[u]:
            continue
        worth[u] = 0.0
        target[u] = -1
        start = seamless.star_start[u]
        end = seamless.star_start[u + 1]
        if seamless.freedom[u] == FIXED or start == end:
            continue
        _mark_neighbours(seamless, u, mark)
        # inside the surface each neighbour is the next corner of one triangle; at a rim the last
        # neighbour is not
        corners_to_try = 1 if seamless.freedom[u] == FREE else 2
        least_flatness = min(_MIN_FLATNESS, _flattest_in_star(seamless, u))
        for i in range(start, end):
            f = seamless.star[i] // 3
            k = seamless.star[i] % 3
            for j in range(1, 1 + corners_to_try):
                m = (k + j) % 3
                v = seamless.F[f, m]
                width = _worth(seamless, parents, at_rim, u, f, k, m, least_flatness)
                if width > worth[u] and _meets_link_condition(seamless, u, v, mark):
                    worth[u] = width
                    target[u] = 3 * f + m


@kernel
def _mark_neighbours(seamless: SeamlessMap, u: int, mark: Ints) -> None:
    """Write u into `mark` [n] at all neighbours of vertex u."""
    for i in range(seamless.star_start[u], seamless.star_start[u + 1]):
        f = seamless.star[i] // 3
        k = seamless.star[i] % 3
        for j in (1, 2):
            mark[seamless.F[f, (k + j) % 3]] = u


@kernel
def _meets_link_condition(seamless: SeamlessMap, u: int, v: int, mark: Ints) -> bool:
    """Whether u and v have as many common neighbours as common triangles.

    The neighbours of u are marked with u in `mark` [n]. Here those that are counted get another
    mark for a while.
    """
    u_is_inner = seamless.freedom[u] == FREE
    v_is_inner = seamless.freedom[v] == FREE
    if v_is_inner and not u_is_inner:
        return False
    counted = -2 - u
    common_neighbours = 0
    common_triangles = 0
    start = seamless.star_start[v]
    end = seamless.star_start[v + 1]
    for i in range(start, end):
        f = seamless.star[i] // 3
        k = seamless.star[i] % 3
        for j in (1, 2):
            w = seamless.F[f, (k + j) % 3]
            if w == u:
                common_triangles += 1
            if mark[w] == u:
                mark[w] = counted
                common_neighbours += 1
    for i in range(start, end):
        f = seamless.star[i] // 3
        k = seamless.star[i] % 3
        for j in (1, 2):
            w = seamless.F[f, (k + j) % 3]
            if mark[w] == counted:
                mark[w] = u
    expected_triangles = 2 if u_is_inner else 1
    return common_neighbours == common_triangles and common_triangles == expected_triangles


@kernel
def _flattest_in_star(seamless: SeamlessMap, u: int) -> float:
    """Flatness of the flattest triangle round a vertex on the charts."""
    flattest = np.inf
    for i in range(seamless.star_start[u], seamless.star_start[u + 1]):
        flattest = min(flattest, _flatness(seamless, seamless.star[i] // 3))
    return flattest


@kernel
def _worth(
    seamless: SeamlessMap,
    parents: Parents,
    at_rim: Bools,
    u: int,
    f: int,
    k: int,
    m: int,
    least_flatness: float,
) -> float:
    """Flatness of the flattest triangle on the charts if u moves to v; 0 if it must not.

    u is corner k of triangle f, and v its corner m. All places are in the frame of u. It must not
    if a triangle would be as flat as `least_flatness` or flatter.
    """
    v = seamless.F[f, m]
    v_is_tip = seamless.freedom[v] == FIXED
    if v_is_tip and at_rim[v]:
        return 0.0  # the frames round a corner of a rim stay as they are
    goal = place_seen_from(seamless, f, k, m)
    flattest_after = np.inf
    for i in range(seamless.star_start[u], seamless.star_start[u + 1]):
        g = seamless.star[i] // 3
        c = seamless.star[i] % 3
        p = (c + 1) % 3
        q = (c + 2) % 3
        a = seamless.F[g, p]
        b = seamless.F[g, q]
        if a == v or b == v:
            continue  # this triangle disappears
        # a triangle with two tips could not move any more
        if v_is_tip and (seamless.freedom[a] == FIXED or seamless.freedom[b] == FIXED):
            return 0.0
        if not _stays_in_parent(seamless, parents, g, p, q, v):
            return 0.0
        to_a = place_seen_from(seamless, g, c, p) - goal
        to_b = place_seen_from(seamless, g, c, q) - goal
        longest_squared = max(square(to_a), square(to_b), square(to_a - to_b))
        flattest_after = min(flattest_after, wedge(to_a, to_b) / longest_squared)
    return flattest_after if flattest_after > least_flatness else 0.0


@kernel
def _flatness(seamless: SeamlessMap, f: int) -> float:
    """Double area of a triangle on the charts over the square of its longest side."""
    a = corner_place(seamless, f, 0)
    b = corner_place(seamless, f, 1)
    c = corner_place(seamless, f, 2)
    return wedge(b - a, c - a) / max(square(b - a), square(c - a), square(c - b))


@kernel
def _stays_in_parent(
    seamless: SeamlessMap, parents: Parents, g: int, p: int, q: int, v: int
) -> bool:
    """Whether v and the corners p and q of triangle g are a triangle inside the parent of g.

    It must have an area, and its orientation must be that of g.
    """
    for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
        h = seamless.star[i] // 3
        c = seamless.star[i] % 3
        if parents.triangle[h] == parents.triangle[g]:
            at_v = parents.inside[h, c]
            at_p = parents.inside[g, p]
            at_q = parents.inside[g, q]
            # the second and third barycentric coordinates are coordinates in the plane
            x_p = at_p[1] - at_v[1]
            y_p = at_p[2] - at_v[2]
            x_q = at_q[1] - at_v[1]
            y_q = at_q[2] - at_v[2]
            return x_p * y_q - y_p * x_q > _MIN_AREA_IN_PARENT
    return False


@kernel
def _best_collapses(seamless: SeamlessMap, order: Ints, worth: Floats, target: Ints) -> Bools:
    """Choose vertices [n] to collapse: the best ones, no two neighbours, no new edge twice.

    `order` [n] has all vertices, best first. For `worth` and `target` see `_find_targets`.
    """
    count = len(order)
    chosen = np.zeros(count, np.bool_)
    is_blocked = np.zeros(count, np.bool_)
    new_edges = {np.int64(-1)}  # numba infers the type of a set from an element
    for u in order:
        if not worth[u] > 0.0:
            break
        if is_blocked[u]:
            continue
        v = seamless.F[target[u] // 3, target[u] % 3]
        start = seamless.star_start[u]
        end = seamless.star_start[u + 1]
        makes_edge_again = False
        for i in range(start, end):
            f = seamless.star[i] // 3
            k = seamless.star[i] % 3
            for j in (1, 2):
                edge = _edge_number(v, seamless.F[f, (k + j) % 3], count)
                makes_edge_again = makes_edge_again or edge in new_edges
        if makes_edge_again:
            continue
        for i in range(start, end):
            f = seamless.star[i] // 3
            k = seamless.star[i] % 3
            for j in (1, 2):
                w = seamless.F[f, (k + j) % 3]
                is_blocked[w] = True
                new_edges.add(_edge_number(v, w, count))
        chosen[u] = True
    return chosen


@kernel
def _edge_number(v: int, w: int, count: int) -> int:
    """A number for the edge between two of `count` vertices."""
    return min(v, w) * count + max(v, w)


@kernel
def _collapse(seamless: SeamlessMap, parents: Parents, chosen: Bools, target: Ints) -> Collapsed:
    """Move each chosen vertex [n] onto its target; see `_find_targets`.

    No two chosen vertices are neighbours, so that a triangle has one of them at most.
    """
    F = seamless.F.copy()
    turn = seamless.turn.copy()
    shift = seamless.shift.copy()
    inside = parents.inside.copy()
    remains = np.ones(len(F), np.bool_)
    for f in range(len(F)):
        k = 0
        while k < 3 and not chosen[seamless.F[f, k]]:
            k += 1
        if k == 3:
            continue
        u = seamless.F[f, k]
        g = target[u] // 3
        m = target[u] % 3
        v = seamless.F[g, m]
        if _corner_at(seamless.F, f, v) >= 0:
            remains[f] = False
            continue
        # from the frame of g by way of the frame of u to the frame of f
        g_to_u = inverse(frame_of(seamless, g, _corner_at(seamless.F, g, u)))
        g_to_f = after(g_to_u, frame_of(seamless, f, k))
        F[f, k] = v
        turn[f, k], shift[f, k] = after(frame_of(seamless, g, m), g_to_f)
        for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
            h = seamless.star[i] // 3
            c = seamless.star[i] % 3
            if parents.triangle[h] == parents.triangle[f]:
                for j in range(3):
                    inside[f, k, j] = parents.inside[h, c, j]
    return Collapsed(remains, F, turn, shift, inside)


@kernel
def _corner_at(F: Ints, f: int, v: int) -> int:
    """The corner of triangle f, of the triangles F [m, 3], at which vertex v lies; -1 if none."""
    for k in range(3):
        if F[f, k] == v:
            return k
    return -1
