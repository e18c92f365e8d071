"""Vertices that leave their chart: their places and frames become those of the chart that they enter."""

from __future__ import annotations

from ...kernel import Floats, kernel
from .frames import after, inverse, turned
from .seamless import COLUMN, FIXED, FREE, ROW, SeamlessMap, Transitions, frame_of

_MOST_CHARTS = 64


@kernel
def rehome(seamless: SeamlessMap, across: Transitions, before: Floats) -> None:
    """Follow each vertex from where it was [n, 2], straight to where it is, over the borders of charts."""
    for v in range(len(seamless.x)):
        if seamless.freedom[v] != FIXED:
            rehome_vertex(seamless, across, v, before[v, 0], before[v, 1])


@kernel
def rehome_vertex(seamless: SeamlessMap, across: Transitions, v: int, px: float, py: float) -> None:
    """Follow one vertex from p, in its chart."""
    qx, qy = seamless.x[v, 0], seamless.x[v, 1]
    if 0.0 <= qx <= 1.0 and 0.0 <= qy <= 1.0:
        return
    chart, turn, sx, sy, x, y = follow(seamless.chart[v], px, py, qx, qy, seamless.glued, across)
    seamless.chart[v], seamless.x[v, 0], seamless.x[v, 1] = chart, x, y
    change = turn, sx, sy
    if turn % 2 == 1 and seamless.freedom[v] != FREE:
        seamless.freedom[v] = COLUMN + ROW - seamless.freedom[v]
    back = inverse(change)
    for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
        f, k = seamless.star[i] // 3, seamless.star[i] % 3
        frame = after(back, frame_of(seamless, f, k))
        seamless.turn[f, k], seamless.shift[f, k, 0], seamless.shift[f, k, 1] = frame


@kernel
def follow(
    chart: int, px: float, py: float, qx: float, qy: float, glued: Floats, across: Transitions
) -> tuple[int, int, int, int, float, float]:
    """Go straight from p, in a chart, to q, in its frame.

    Returns
    -------
    chart, turn, shift x, shift y, x, y
        The chart in which q lies, the change to its frame, and q there.
    """
    turn, sx, sy, came = 0, 0, 0, -1
    for _ in range(_MOST_CHARTS):
        # the side through which the way leaves the square
        side, least = -1, 1.0
        if qy < 0.0 and came != 0 and py / (py - qy) < least:
            side, least = 0, py / (py - qy)
        if qx > 1.0 and came != 1 and (1.0 - px) / (qx - px) < least:
            side, least = 1, (1.0 - px) / (qx - px)
        if qy > 1.0 and came != 2 and (1.0 - py) / (qy - py) < least:
            side, least = 2, (1.0 - py) / (qy - py)
        if qx < 0.0 and came != 3 and px / (px - qx) < least:
            side, least = 3, px / (px - qx)
        if side < 0 or glued[chart, side, 0] < 0:
            break
        t, ax, ay = across.turn[chart, side], across.shift[chart, side, 0], across.shift[chart, side, 1]
        px, py = turned(px, py, t)
        qx, qy = turned(qx, qy, t)
        px, py, qx, qy = px + ax, py + ay, qx + ax, qy + ay
        x, y = turned(float(sx), float(sy), t)
        sx, sy, turn = int(x) + ax, int(y) + ay, (turn + t) % 4
        chart, came = glued[chart, side, 0], glued[chart, side, 1]
    return chart, turn, sx, sy, qx, qy
