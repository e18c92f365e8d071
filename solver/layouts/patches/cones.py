"""Tips of cones that move over the surface.

The tips sit on vertices, where the cells' corners and middles happened to be, and a tip in the wrong place strains the
map round it until texels beside it fold. So a tip may move on to a neighbouring vertex, if that lowers the energy: what
was a cone's vertex becomes a free one, and its neighbour is fixed on the tip. Frames change only in the two stars: a
turn round the old vertex is now nothing, a turn round the new one what the old one's was.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, Ints, kernel
from ..energy import FIXED, FREE
from .energy import ChartShapes, energy_of, gather, star_energy, sweep
from .relaxation import scratch
from .seamless import SeamlessMap, Transitions, after, follow, frame_of, inverse, turned

_LAYERS = 3  # of vertices that a tip's move may move
_SWEEPS = 3  # over the vertices round a tip, before it is judged
_WORTH = 1e-3  # share of the energy round a tip that a move must save


def move_tips(seamless: SeamlessMap, shapes: ChartShapes, across: Transitions, tips: Ints) -> Ints:
    """Move each of these tips to the first neighbour where the energy is lower; return where those are that moved."""
    return _move_tips(seamless, shapes, across, tips, scratch(seamless))


@kernel
def _move_tips(seamless: SeamlessMap, shapes: ChartShapes, across: Transitions, tips: Ints, star: Floats) -> Ints:
    fan = np.empty((2, len(star)), np.int64)
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
            vertices, triangles = _around(seamless, v, u, mark, stamp)
            if len(vertices) and _moved(seamless, shapes, across, vertices, triangles, fan, star):
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
def _around(seamless: SeamlessMap, v: int, u: int, mark: Ints, stamp: int) -> tuple[Ints, Ints]:
    """A tip, the vertex that it may move to and those round both; all triangles at these.

    Nothing if there is another tip among their neighbours. `mark` [n + m] holds older stamps.
    """
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
                    return np.empty(0, np.int64), np.empty(0, np.int64)
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
    return np.array(vertices), np.array(triangles)


@kernel
def _moved(
    seamless: SeamlessMap,
    shapes: ChartShapes,
    across: Transitions,
    vertices: Ints,
    triangles: Ints,
    fan: Ints,
    star: Floats,
) -> bool:
    """Try to move a tip; whether it stays there."""
    before = energy_of(seamless, shapes, triangles)
    x, chart, freedom = seamless.x[vertices], seamless.chart[vertices], seamless.freedom[vertices]
    turn, shift = seamless.turn[triangles], seamless.shift[triangles]
    v, u = vertices[0], vertices[1]
    _change_frames(seamless, v, u, fan)
    degree = gather(seamless, shapes, v, star)
    _put_into_star(seamless, shapes, v, u, star, degree)
    angle = 0.0
    for i in range(degree):
        px, py = star[i, 0] - seamless.x[v, 0], star[i, 1] - seamless.x[v, 1]
        qx, qy = star[i, 2] - seamless.x[v, 0], star[i, 3] - seamless.x[v, 1]
        angle += np.arctan2(px * qy - py * qx, px * qx + py * qy)
    _enter_chart(seamless, across, v)
    # round a wide cone's vertex the map may wind twice without a fold
    if angle < 3.0 * np.pi and energy_of(seamless, shapes, triangles) < np.inf:
        for _ in range(_SWEEPS):
            sweep(seamless, shapes, across, vertices, star, True)
        if energy_of(seamless, shapes, triangles) < (1.0 - _WORTH) * before:
            return True
    for i in range(len(vertices)):
        w = vertices[i]
        seamless.x[w], seamless.chart[w], seamless.freedom[w] = x[i], chart[i], freedom[i]
    for i in range(len(triangles)):
        seamless.turn[triangles[i]], seamless.shift[triangles[i]] = turn[i], shift[i]
    return False


@kernel
def _put_into_star(seamless: SeamlessMap, shapes: ChartShapes, u: int, v: int, star: Floats, degree: int) -> None:
    """Put u, in the frame that it begins with, on a way from v, where its star's energy is least and nothing folded."""
    start = seamless.star_start[u]
    x = y = left_x = left_y = right_x = right_y = middle_x = middle_y = 0.0
    for i in range(degree):
        f, k = seamless.star[start + i] // 3, seamless.star[start + i] % 3
        a, b = seamless.F[f, (k + 1) % 3], seamless.F[f, (k + 2) % 3]
        middle_x += (star[i, 0] + star[i, 2]) / (2 * degree)
        middle_y += (star[i, 1] + star[i, 3]) / (2 * degree)
        if a == v:
            x, y, left_x, left_y = star[i, 0], star[i, 1], star[i, 2], star[i, 3]
        elif b == v:
            x, y, right_x, right_y = star[i, 2], star[i, 3], star[i, 0], star[i, 1]
    inward_x, inward_y = _inward(x, y, left_x, left_y, right_x, right_y)
    least, best_x, best_y = np.inf, x, y
    for way in range(2):
        goal_x, goal_y = (middle_x, middle_y) if way == 0 else (x + inward_x, y + inward_y)
        share, trials = (0.65, 16) if way == 0 else (0.4, 40)
        t = 0.65
        for _ in range(trials):
            px, py = x + t * (goal_x - x), y + t * (goal_y - y)
            energy = star_energy(star, degree, px, py, shapes.power)
            if energy < least:
                least, best_x, best_y = energy, px, py
            elif least < np.inf:
                break
            t *= share
        if least < np.inf:
            break
    seamless.x[u, 0], seamless.x[u, 1] = best_x, best_y


@kernel
def _inward(x: float, y: float, lx: float, ly: float, rx: float, ry: float) -> tuple[float, float]:
    """Direction between those to two neighbours, as long as the shorter."""
    ax, ay, bx, by = lx - x, ly - y, rx - x, ry - y
    a, b = np.hypot(ax, ay), np.hypot(bx, by)
    # the normals of the two sides, inwards
    sx, sy = by / b - ay / a, ax / a - bx / b
    length = np.hypot(sx, sy)
    if not length > 1e-9:
        return ax, ay
    size = min(a, b) / length
    return sx * size, sy * size


@kernel
def _enter_chart(seamless: SeamlessMap, across: Transitions, u: int) -> None:
    """Find the chart in which u lies, on a straight way from a neighbour, and take its frame."""
    first, last = seamless.star_start[u], seamless.star_start[u + 1]
    f, k, j = 0, 0, -1
    for i in range(first, last):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        for m in (1, 2):
            if j < 0 and seamless.freedom[seamless.F[f, (k + m) % 3]] != FIXED:
                j = m
        if j >= 0:
            break
    w = seamless.F[f, (k + j) % 3]
    change = after(frame_of(seamless, f, k), inverse(frame_of(seamless, f, (k + j) % 3)))
    qx, qy = turned(seamless.x[u, 0], seamless.x[u, 1], change[0])
    qx, qy = qx + change[1], qy + change[2]
    chart, turn, sx, sy, px, py = follow(
        seamless.chart[w], seamless.x[w, 0], seamless.x[w, 1], qx, qy, seamless.glued, across
    )
    change = after(change, (turn, sx, sy))
    seamless.chart[u], seamless.x[u, 0], seamless.x[u, 1] = chart, px, py
    back = inverse(change)
    for i in range(first, last):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        seamless.turn[f, k], seamless.shift[f, k, 0], seamless.shift[f, k, 1] = after(back, frame_of(seamless, f, k))


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
