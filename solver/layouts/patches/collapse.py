"""Taking away vertices that only cuts have made, by half-edge collapses that fold nothing.

Cuts along the borders of cells and charts leave three times as many triangles as there were, most
of them slivers. Once the charts are known to the map, the cuts are not needed any more. In each
round the best collapses are done, none of two neighbours, so that all are judged on the same
triangles.

A half-edge collapse must meet the link condition, keep every triangle inside its parent on the
mesh, and turn none over, neither there nor on the charts.
"""

from __future__ import annotations

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
    square,
    stars,
    turned,
    wedge,
)
from .surface import TriangleSurface

# Double area over squared length of a triangle on the charts after a collapse, at least. Where a
# triangle is flatter already, such as a piece of a needle, a collapse must make none flatter.
_MIN_FLATNESS = 0.05

# Double area of a triangle in its parent, in barycentric coordinates, at least.
_MIN_AREA_IN_PARENT = 1e-9

# Where the triangles lie on the mesh: parent [m], and barycentrics in it of their corners [m, 3, 3]
Parents = tuple[Ints, Floats]

# Rounds of collapses, at most.
_MAX_ROUNDS = 20

# Share of the vertices in question that a round must remove for another round to follow.
_MIN_COLLAPSED_SHARE = 0.01


@kernel
def _find_targets(
    seamless: SeamlessMap,
    parents: Parents,
    chosen: Bools,
    at_rim: Bools,
    worth: Floats,
    target: Ints,
) -> None:
    """Fill in how good the best collapse of chosen vertices is, and to which corner it leads.

    It is above 0 where there is one. Corner k of triangle f has the number 3 f + k.
    """
    n = len(seamless.z)
    seen = np.full(n, -1)
    for u in range(n):
        first = seamless.star_start[u]
        last = seamless.star_start[u + 1]
        if not chosen[u]:
            continue
        worth[u] = 0.0
        target[u] = -1
        if seamless.freedom[u] == FIXED or first == last:
            continue
        for i in range(first, last):
            f = seamless.star[i] // 3
            k = seamless.star[i] % 3
            for j in (1, 2):
                seen[seamless.F[f, (k + j) % 3]] = u
        for i in range(first, last):
            f = seamless.star[i] // 3
            k = seamless.star[i] % 3
            for j in range(1, 2 if seamless.freedom[u] == FREE else 3):  # each neighbour once
                m = (k + j) % 3
                good = _worth(seamless, parents, at_rim, u, f, k, m)
                if good > worth[u] and _meets(seamless, u, seamless.F[f, m], seen):
                    worth[u] = good
                    target[u] = 3 * f + m


@kernel
def _meets(seamless: SeamlessMap, u: int, v: int, seen: Ints) -> bool:
    """The link condition for u and v: they share as many neighbours as triangles.

    The neighbours of u are marked in `seen`.
    """
    inner = seamless.freedom[u] == FREE
    if seamless.freedom[v] == FREE and not inner:
        return False
    shared = beside = 0
    first = seamless.star_start[v]
    last = seamless.star_start[v + 1]
    for i in range(first, last):
        f = seamless.star[i] // 3
        k = seamless.star[i] % 3
        for j in (1, 2):
            w = seamless.F[f, (k + j) % 3]
            beside += w == u
            if seen[w] == u:  # each once
                seen[w] = -2 - u
                shared += 1
    for i in range(first, last):
        f = seamless.star[i] // 3
        k = seamless.star[i] % 3
        for j in (1, 2):
            w = seamless.F[f, (k + j) % 3]
            if seen[w] == -2 - u:
                seen[w] = u
    return shared == beside and beside == (2 if inner else 1)


@kernel
def _worth(
    seamless: SeamlessMap, parents: Parents, at_rim: Bools, u: int, f: int, k: int, m: int
) -> float:
    """Width of the flattest triangle on the charts if u goes to corner m; 0 if it may not.

    u is corner k of triangle f.
    """
    v = seamless.F[f, m]
    held = seamless.freedom[v] == FIXED
    if held and at_rim[v]:
        return 0.0  # the frames round a corner of a rim stay as they are
    turn, shift = inverse(frame_of(seamless, f, k))
    goal = turned(corner_place(seamless, f, m), turn) + shift
    flattest = np.inf
    flattest_before = np.inf
    for i in range(seamless.star_start[u], seamless.star_start[u + 1]):
        g = seamless.star[i] // 3
        c = seamless.star[i] % 3
        p = (c + 1) % 3
        q = (c + 2) % 3
        a = seamless.F[g, p]
        b = seamless.F[g, q]
        flattest_before = min(flattest_before, _flatness(seamless, g))
        if a == v or b == v:
            continue
        # two tips in a triangle would leave it no way to move
        if held and (seamless.freedom[a] == FIXED or seamless.freedom[b] == FIXED):
            return 0.0
        if not _inside(seamless, parents, g, p, q, v):
            return 0.0
        turn, shift = inverse(frame_of(seamless, g, c))
        to_a = turned(corner_place(seamless, g, p), turn) + shift - goal
        to_b = turned(corner_place(seamless, g, q), turn) + shift - goal
        longest = max(square(to_a), square(to_b), square(to_a - to_b))
        flattest = min(flattest, wedge(to_a, to_b) / longest)
    return flattest if flattest > min(_MIN_FLATNESS, flattest_before) else 0.0


@kernel
def _flatness(seamless: SeamlessMap, f: int) -> float:
    """Double area of a triangle on the charts over the square of its longest side."""
    a = corner_place(seamless, f, 0)
    b = corner_place(seamless, f, 1)
    c = corner_place(seamless, f, 2)
    return wedge(b - a, c - a) / max(square(b - a), square(c - a), square(c - b))


@kernel
def _inside(seamless: SeamlessMap, parents: Parents, g: int, p: int, q: int, v: int) -> bool:
    """Whether v with corners p and q of triangle g makes a triangle inside the parent of g.

    The triangle must be turned as g is.
    """
    for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
        h = seamless.star[i] // 3
        c = seamless.star[i] % 3
        if parents[0][h] == parents[0][g]:
            o = parents[1][h, c]
            a = parents[1][g, p]
            b = parents[1][g, q]
            ux = a[1] - o[1]
            uy = a[2] - o[2]
            vx = b[1] - o[1]
            vy = b[2] - o[2]
            return ux * vy - uy * vx > _MIN_AREA_IN_PARENT
    return False


def without_cuts(
    surface: TriangleSurface, seamless: SeamlessMap, cut: Bools
) -> tuple[TriangleSurface, SeamlessMap]:
    """The same map on fewer triangles: vertices `cut` [n] are gone where that folds nothing."""
    parents = surface.parent, np.ascontiguousarray(surface.inside)
    count = len(seamless.z)
    worth = np.zeros(count)
    target = np.full(count, -1)
    changed = cut
    for _ in range(_MAX_ROUNDS):
        _find_targets(seamless, parents, cut & changed, surface.at_rim, worth, target)
        chosen = _chosen(seamless, np.argsort(-worth, kind="stable"), worth, target)
        if chosen.sum() <= _MIN_COLLAPSED_SHARE * cut.sum():
            break
        left, F, turn, shift, inside = _collapse(seamless, parents, chosen, target)
        # what a collapse is worth depends on the stars of a vertex and of its neighbours
        changed = _with_neighbours(seamless.F, _with_neighbours(seamless.F, chosen))
        number = np.cumsum(left) - 1
        target = np.where(changed, -1, 3 * number[target // 3] + target % 3)
        F = F[left]
        frame = seamless.frame[left]
        turn = turn[left]
        shift = shift[left]
        start, star = stars(F, len(seamless.z))
        seamless = seamless._replace(
            F=F, frame=frame, turn=turn, shift=shift, star_start=start, star=star
        )
        parents = parents[0][left], inside[left]
    used, F = np.unique(seamless.F, return_inverse=True)
    start, star = stars(F, len(used))
    seamless = seamless._replace(
        F=F,
        chart=seamless.chart[used],
        z=seamless.z[used],
        freedom=seamless.freedom[used],
        star_start=start,
        star=star,
    )
    return TriangleSurface(surface.V[used], F, parents[0], parents[1]), seamless


def _with_neighbours(F: Ints, chosen: Bools) -> Bools:
    """Chosen vertices [n] and all that share one of the triangles F [m, 3] with them."""
    wider = chosen.copy()
    wider[F[chosen[F].any(axis=1)]] = True
    return wider


@kernel
def _chosen(seamless: SeamlessMap, order: Ints, worth: Floats, target: Ints) -> Bools:
    """The best collapses, none of two neighbours, and none that make the same edge."""
    n = len(order)
    chosen = np.zeros(n, np.bool_)
    blocked = np.zeros(n, np.bool_)
    made = {np.int64(-1)}
    for u in order:
        if not worth[u] > 0.0:
            break
        if blocked[u]:
            continue
        v = seamless.F[target[u] // 3, target[u] % 3]
        first = seamless.star_start[u]
        last = seamless.star_start[u + 1]
        free = True
        for i in range(first, last):
            f = seamless.star[i] // 3
            k = seamless.star[i] % 3
            for j in (1, 2):
                w = seamless.F[f, (k + j) % 3]
                free = free and (min(v, w) * n + max(v, w)) not in made
        if not free:
            continue
        for i in range(first, last):
            f = seamless.star[i] // 3
            k = seamless.star[i] % 3
            for j in (1, 2):
                w = seamless.F[f, (k + j) % 3]
                blocked[w] = True
                made.add(min(v, w) * n + max(v, w))
        chosen[u] = True
    return chosen


@kernel
def _collapse(
    seamless: SeamlessMap, parents: Parents, chosen: Bools, target: Ints
) -> tuple[Bools, Ints, Ints, Complex, Floats]:
    """The triangles that are left, with changes of frames and the corners' places in their parents.

    Of all vertices: the changes to their frames, and where in their parents they lie.
    """
    F = seamless.F.copy()
    turn = seamless.turn.copy()
    shift = seamless.shift.copy()
    inside = parents[1].copy()
    left = np.ones(len(F), np.bool_)
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
        if v == seamless.F[f, 0] or v == seamless.F[f, 1] or v == seamless.F[f, 2]:
            left[f] = False
            continue
        at_u = 0 if seamless.F[g, 0] == u else (1 if seamless.F[g, 1] == u else 2)
        through_u = after(inverse(frame_of(seamless, g, at_u)), frame_of(seamless, f, k))
        F[f, k] = v
        turn[f, k], shift[f, k] = after(frame_of(seamless, g, m), through_u)
        for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
            h = seamless.star[i] // 3
            c = seamless.star[i] % 3
            if parents[0][h] == parents[0][f]:
                for j in range(3):
                    inside[f, k, j] = parents[1][h, c, j]
    return left, F, turn, shift, inside
