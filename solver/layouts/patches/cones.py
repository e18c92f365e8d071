"""Tips of cones that move over the surface.

The tips sit on vertices, where the cells' corners and middles happened to be, and a tip in the wrong place strains the
map round it until texels beside it fold. So a tip may move on to a neighbouring vertex, if that lowers the energy: what
was a cone's vertex becomes a free one, and its neighbour is fixed on the tip. Frames change only in the two stars: a
turn round the old vertex is now nothing, a turn round the new one what the old one's was.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Floats, Ints, kernel
from .energy import FOLDED, Reference, density, shape_of
from .frames import after, inverse, turned
from .insertion import place, settle
from .seamless import FIXED, FREE, SeamlessMap, Transitions, frame_of
from .sweep import TERMS, gather, relax_vertex
from .wander import rehome_vertex

_LAYERS = 3  # of vertices that a tip's move may move
_SWEEPS = 3  # over the vertices round a tip, before it is judged
_WORTH = 1e-3  # share of the energy round a tip that a move must save


class _Round(NamedTuple):
    """What lies round a tip and the vertex that it may move to."""

    vertices: Ints  # [k], of both stars, those two first
    triangles: Ints  # [l], all at these vertices


@kernel
def move_tips(seamless: SeamlessMap, reference: Reference, across: Transitions, tips: Ints) -> Ints:
    """Move each of these tips to the first neighbour where the energy is lower; return where those are that moved."""
    largest = 0
    for v in range(len(seamless.x)):
        largest = max(largest, seamless.star_start[v + 1] - seamless.star_start[v])
    star, fan = np.empty((largest, TERMS)), np.empty((2, largest), np.int64)
    mark = np.zeros(len(seamless.x) + len(seamless.F), np.int64)
    count = stamp = 0
    moved = np.empty(len(tips), np.int64)
    for v in tips:
        for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
            h = seamless.star[i]
            u = seamless.F[h // 3, (h % 3 + 1) % 3]
            corner = 3 * (h // 3) + (h % 3 + 1) % 3
            if seamless.freedom[u] != FREE or not (_fan(seamless, v, h, fan[0]) and _fan(seamless, u, corner, fan[1])):
                continue
            stamp += 1
            beside = _beside(seamless, v, u, mark, stamp)
            if len(beside.vertices) and _moved(seamless, reference, across, beside, fan, star):
                moved[count] = u
                count += 1
                break
    return moved[:count]


@kernel
def _fan(seamless: SeamlessMap, v: int, h: int, fan: Ints) -> bool:
    """Corners of v, counter-clockwise from corner h; whether they go all round it."""
    first, last = seamless.star_start[v], seamless.star_start[v + 1]
    for i in range(last - first):
        fan[i] = h
        wanted = seamless.F[h // 3, (h % 3 + 2) % 3]
        h = -1
        for j in range(first, last):
            g = seamless.star[j]
            if seamless.F[g // 3, (g % 3 + 1) % 3] == wanted:
                h = g
        if h < 0:
            return False
    return h == fan[0]


@kernel
def _beside(seamless: SeamlessMap, v: int, u: int, mark: Ints, stamp: int) -> _Round:
    """Both stars with all triangles round them; nothing if there is another tip. `mark` [n + m] holds older stamps."""
    n = len(seamless.x)
    vertices, triangles = [v, u], [np.int64(0) for _ in range(0)]
    mark[v] = mark[u] = stamp
    first, last = 0, 2
    for layer in range(_LAYERS):
        for at in range(first, last):
            for i in range(seamless.star_start[vertices[at]], seamless.star_start[vertices[at] + 1]):
                h = seamless.star[i]
                w = seamless.F[h // 3, (h % 3 + 1) % 3]
                if layer == 0 and seamless.freedom[w] == FIXED and w != v:
                    return _Round(np.empty(0, np.int64), np.empty(0, np.int64))
                if mark[w] != stamp:
                    mark[w] = stamp
                    vertices.append(w)
        first, last = last, len(vertices)
    for w in vertices:
        for i in range(seamless.star_start[w], seamless.star_start[w + 1]):
            f = seamless.star[i] // 3
            if mark[n + f] != stamp:
                mark[n + f] = stamp
                triangles.append(f)
    return _Round(np.array(vertices), np.array(triangles))


@kernel
def _moved(
    seamless: SeamlessMap, reference: Reference, across: Transitions, beside: _Round, fan: Ints, star: Floats
) -> bool:
    """Try to move a tip; whether it stays there."""
    vertices, triangles = beside.vertices, beside.triangles
    before = _energy(seamless, reference, triangles)
    x, chart, freedom = seamless.x[vertices], seamless.chart[vertices], seamless.freedom[vertices]
    turn, shift = seamless.turn[triangles], seamless.shift[triangles]
    v, u = vertices[0], vertices[1]
    _change_frames(seamless, v, u, fan)
    degree = gather(seamless, reference, v, star)
    place(seamless, reference, v, u, star, degree)
    once = _angle(star, degree, seamless.x[v, 0], seamless.x[v, 1]) < 3.0 * np.pi
    settle(seamless, across, v)
    # round a wide cone's vertex the map may wind twice without a fold
    if once and _energy(seamless, reference, triangles) < np.inf:
        for _ in range(_SWEEPS):
            for w in vertices:
                if seamless.freedom[w] != FIXED:
                    px, py = seamless.x[w, 0], seamless.x[w, 1]
                    relax_vertex(seamless, reference, w, star)
                    rehome_vertex(seamless, across, w, px, py)
        if _energy(seamless, reference, triangles) < (1.0 - _WORTH) * before:
            return True
    for i in range(len(vertices)):
        w = vertices[i]
        seamless.x[w], seamless.chart[w], seamless.freedom[w] = x[i], chart[i], freedom[i]
    for i in range(len(triangles)):
        seamless.turn[triangles[i]], seamless.shift[triangles[i]] = turn[i], shift[i]
    return False


@kernel
def _energy(seamless: SeamlessMap, reference: Reference, triangles: Ints) -> float:
    """Energy of some triangles; infinite if one is folded."""
    total = 0.0
    for f in triangles:
        dirichlet, jacobian, area = shape_of(seamless, reference, f)
        if not area > FOLDED:
            return np.inf
        total += reference.area[f] * density(dirichlet, jacobian, reference.power)
    return total


@kernel
def _angle(star: Floats, degree: int, x: float, y: float) -> float:
    """Angle round the vertex of a star that lies at x, y."""
    total = 0.0
    for i in range(degree):
        ux, uy, vx, vy = star[i, 0] - x, star[i, 1] - y, star[i, 2] - x, star[i, 3] - y
        total += np.arctan2(ux * vy - uy * vx, ux * vx + uy * vy)
    return total


@kernel
def _change_frames(seamless: SeamlessMap, v: int, u: int, fan: Ints) -> None:
    """Free the tip's vertex v, and put u on the tip; fan [2, d] has the corners of both from the edge between them."""
    degree = seamless.star_start[v + 1] - seamless.star_start[v]
    around = seamless.star_start[u + 1] - seamless.star_start[u]
    h = fan[0, 0]
    tip_x, tip_y = seamless.shift[h // 3, h % 3]
    # v takes the frame of its first triangle, and carries it round without crossing the edge to u
    frame = 0, 0, 0
    for i in range(degree):
        h = fan[0, i]
        f, k = h // 3, h % 3
        seamless.turn[f, k], seamless.shift[f, k, 0], seamless.shift[f, k, 1] = frame
        g = fan[0, (i + 1) % degree]
        frame = after(frame, _change(seamless, f, (k + 2) % 3, g // 3, (g % 3 + 1) % 3))
    # the triangles of u see the tip, clockwise from the first, which was v's too
    for i in range(around):
        h = fan[1, (around - i) % around]
        f, k = h // 3, h % 3
        if i > 0:
            before = fan[1, (around - i + 1) % around]
            change = _change(seamless, before // 3, (before % 3 + 1) % 3, f, (k + 2) % 3)
            px, py = turned(float(tip_x), float(tip_y), change[0])
            tip_x, tip_y = int(px) + change[1], int(py) + change[2]
        seamless.turn[f, k], seamless.shift[f, k, 0], seamless.shift[f, k, 1] = 0, tip_x, tip_y
    seamless.x[u] = 0.0
    seamless.freedom[u], seamless.freedom[v] = FIXED, FREE


@kernel
def _change(seamless: SeamlessMap, f: int, k: int, g: int, m: int) -> tuple[int, int, int]:
    """From the frame of triangle f to that of g, which share a free vertex: corner k of one and m of the other."""
    return after(inverse(frame_of(seamless, f, k)), frame_of(seamless, g, m))
