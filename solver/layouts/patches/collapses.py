"""Which vertices of a map may be merged with a neighbour, and how good that is.

A half-edge collapse must meet the link condition, keep every triangle inside its parent on the mesh, and turn none
over, neither there nor on the charts.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Bools, Floats, Ints, kernel
from .frames import inverse, turned
from .seamless import FIXED, FREE, SeamlessMap, corner_place, frame_of

_FLATTEST = 0.05  # double area over squared length of a triangle on the charts after a collapse
_LEAST_INSIDE = 1e-9  # double area of a triangle in its parent, in barycentric coordinates


class Parents(NamedTuple):
    """Where the triangles lie on the mesh."""

    parent: Ints  # [m]
    inside: Floats  # [m, 3, 3]


@kernel
def targets(seamless: SeamlessMap, parents: Parents, cut: Bools) -> tuple[Floats, Ints]:
    """How good the best collapse of each vertex is, above 0 [n], and a corner 3 triangle + k: to where it goes."""
    n = len(seamless.x)
    worth, target, seen = np.zeros(n), np.full(n, -1), np.full(n, -1)
    for u in range(n):
        first, last = seamless.star_start[u], seamless.star_start[u + 1]
        if not cut[u] or seamless.freedom[u] == FIXED or first == last:
            continue
        for i in range(first, last):
            f, k = seamless.star[i] // 3, seamless.star[i] % 3
            for j in (1, 2):
                seen[seamless.F[f, (k + j) % 3]] = u
        for i in range(first, last):
            f, k = seamless.star[i] // 3, seamless.star[i] % 3
            for j in range(1, 2 if seamless.freedom[u] == FREE else 3):  # each neighbour once
                m = (k + j) % 3
                good = _worth(seamless, parents, u, f, k, m)
                if good > worth[u] and _meets(seamless, u, seamless.F[f, m], seen):
                    worth[u], target[u] = good, 3 * f + m
    return worth, target


@kernel
def _meets(seamless: SeamlessMap, u: int, v: int, seen: Ints) -> bool:
    """The link condition: u, whose neighbours are marked in `seen`, shares as many of these with v as triangles."""
    inner = seamless.freedom[u] == FREE
    if seamless.freedom[v] == FREE and not inner:
        return False
    shared = beside = 0
    first, last = seamless.star_start[v], seamless.star_start[v + 1]
    for i in range(first, last):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        for j in (1, 2):
            w = seamless.F[f, (k + j) % 3]
            beside += w == u
            if seen[w] == u:  # each once
                seen[w] = -2 - u
                shared += 1
    for i in range(first, last):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        for j in (1, 2):
            w = seamless.F[f, (k + j) % 3]
            if seen[w] == -2 - u:
                seen[w] = u
    return shared == beside and beside == (2 if inner else 1)


@kernel
def _worth(seamless: SeamlessMap, parents: Parents, u: int, f: int, k: int, m: int) -> float:
    """Width of the flattest triangle on the charts if u, corner k of triangle f, goes to corner m; 0 if it may not."""
    v = seamless.F[f, m]
    held = seamless.freedom[v] == FIXED
    if held and _at_rim(seamless, v):
        return 0.0  # the frames round a corner of a rim stay as they are
    to_u = inverse(frame_of(seamless, f, k))
    vx, vy = corner_place(seamless, f, m)
    vx, vy = turned(vx, vy, to_u[0])
    vx, vy = vx + to_u[1], vy + to_u[2]
    flattest = np.inf
    for i in range(seamless.star_start[u], seamless.star_start[u + 1]):
        g, c = seamless.star[i] // 3, seamless.star[i] % 3
        p, q = (c + 1) % 3, (c + 2) % 3
        a, b = seamless.F[g, p], seamless.F[g, q]
        if a == v or b == v:
            continue
        # two tips in a triangle would leave it no way to move
        if held and (seamless.freedom[a] == FIXED or seamless.freedom[b] == FIXED):
            return 0.0
        if not _inside(seamless, parents, g, p, q, v):
            return 0.0
        to_u = inverse(frame_of(seamless, g, c))
        ax, ay = corner_place(seamless, g, p)
        bx, by = corner_place(seamless, g, q)
        ax, ay = turned(ax, ay, to_u[0])
        bx, by = turned(bx, by, to_u[0])
        ax, ay, bx, by = ax + to_u[1] - vx, ay + to_u[2] - vy, bx + to_u[1] - vx, by + to_u[2] - vy
        longest = max(ax * ax + ay * ay, bx * bx + by * by, (ax - bx) ** 2 + (ay - by) ** 2)
        flattest = min(flattest, (ax * by - ay * bx) / longest)
    return flattest if flattest > _FLATTEST else 0.0


@kernel
def _at_rim(seamless: SeamlessMap, v: int) -> bool:
    """Whether the triangles of a vertex do not close round it: then some neighbour is seen once."""
    first, last = seamless.star_start[v], seamless.star_start[v + 1]
    for i in range(first, last):
        w = seamless.F[seamless.star[i] // 3, (seamless.star[i] % 3 + 1) % 3]
        again = False
        for j in range(first, last):
            again = again or seamless.F[seamless.star[j] // 3, (seamless.star[j] % 3 + 2) % 3] == w
        if not again:
            return True
    return False


@kernel
def _inside(seamless: SeamlessMap, parents: Parents, g: int, p: int, q: int, v: int) -> bool:
    """Whether v with corners p and q of triangle g makes a triangle inside of g's parent, as it is turned."""
    for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
        h, c = seamless.star[i] // 3, seamless.star[i] % 3
        if parents.parent[h] == parents.parent[g]:
            o, a, b = parents.inside[h, c], parents.inside[g, p], parents.inside[g, q]
            ux, uy, vx, vy = a[1] - o[1], a[2] - o[2], b[1] - o[1], b[2] - o[2]
            return ux * vy - uy * vx > _LEAST_INSIDE
    return False
