"""Taking away vertices that only cuts have made, by half-edge collapses that fold nothing.

Cuts along the borders of cells and charts leave three times as many triangles as there were, most of them slivers. Once
the charts are known to the map, the cuts are not needed any more. In each round the best collapses are done, none of
two neighbours, so that all are judged on the same triangles.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Bools, Floats, Ints, kernel
from .collapses import Parents, targets
from .frames import after, inverse
from .seamless import SeamlessMap, frame_of, stars
from .surface import Surface

_MOST_ROUNDS, _LEAST_SHARE = 20, 0.01  # of the vertices in question, in a round that is worth another


def without_cuts(surface: Surface, seamless: SeamlessMap, cut: Bools) -> tuple[Surface, SeamlessMap]:
    """The same map on fewer triangles: vertices `cut` [n] are gone where that folds nothing."""
    parents = Parents(surface.parent, np.ascontiguousarray(surface.inside))
    for _ in range(_MOST_ROUNDS):
        worth, target = targets(seamless, parents, cut)
        chosen = _chosen(seamless, np.argsort(-worth, kind="stable"), worth, target)
        if chosen.sum() <= _LEAST_SHARE * cut.sum():
            break
        seamless, parents = _collapsed(seamless, parents, chosen, target)
    used, F = np.unique(seamless.F, return_inverse=True)
    F = F.reshape(-1, 3)
    start, star = stars(F, len(used))
    seamless = seamless._replace(
        F=F,
        chart=seamless.chart[used],
        x=seamless.x[used],
        freedom=seamless.freedom[used],
        star_start=start,
        star=star,
    )
    return Surface(surface.V[used], F, parents.parent, parents.inside), seamless


@kernel
def _chosen(seamless: SeamlessMap, order: Ints, worth: Floats, target: Ints) -> Bools:
    """The best collapses, none of two neighbours, and none that make the same edge."""
    n = len(order)
    chosen, blocked, made = np.zeros(n, np.bool_), np.zeros(n, np.bool_), {np.int64(-1)}
    for u in order:
        if not worth[u] > 0.0:
            break
        if blocked[u]:
            continue
        v = seamless.F[target[u] // 3, target[u] % 3]
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
    return chosen


@kernel
def _collapsed(seamless: SeamlessMap, parents: Parents, chosen: Bools, target: Ints) -> tuple[SeamlessMap, Parents]:
    F, frame, turn, shift = seamless.F.copy(), seamless.frame.copy(), seamless.turn.copy(), seamless.shift.copy()
    parent, inside = parents.parent.copy(), parents.inside.copy()
    size = 0
    for f in range(len(F)):
        k = 0
        while k < 3 and not chosen[seamless.F[f, k]]:
            k += 1
        F[size], turn[size], shift[size], frame[size] = (
            seamless.F[f],
            seamless.turn[f],
            seamless.shift[f],
            seamless.frame[f],
        )
        parent[size], inside[size] = parents.parent[f], parents.inside[f]
        if k < 3:
            u = seamless.F[f, k]
            g, m = target[u] // 3, target[u] % 3
            v = seamless.F[g, m]
            if v == seamless.F[f, 0] or v == seamless.F[f, 1] or v == seamless.F[f, 2]:
                continue
            at_u = 0 if seamless.F[g, 0] == u else (1 if seamless.F[g, 1] == u else 2)
            through_u = after(inverse(frame_of(seamless, g, at_u)), frame_of(seamless, f, k))
            change = after(frame_of(seamless, g, m), through_u)
            F[size, k], turn[size, k], shift[size, k, 0], shift[size, k, 1] = v, change[0], change[1], change[2]
            for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
                h, c = seamless.star[i] // 3, seamless.star[i] % 3
                if parents.parent[h] == parents.parent[f]:
                    inside[size, k] = parents.inside[h, c]
        size += 1
    start, star = stars(F[:size], len(seamless.x))
    coarser = SeamlessMap(
        F[:size],
        frame[:size],
        seamless.chart,
        seamless.x,
        seamless.freedom,
        turn[:size],
        shift[:size],
        seamless.glued,
        start,
        star,
    )
    return coarser, Parents(parent[:size], inside[:size])
