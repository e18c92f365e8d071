"""Vertices that leave their chart: their places and frames become those of the chart that they enter."""

from __future__ import annotations

from ripple_sim.solver.kernel import Floats, kernel

from .seamless import COLUMN, FIXED, FREE, ROW, SeamlessMap, Transitions, turned

_MOST_CHARTS = 64


@kernel
def rehome(seamless: SeamlessMap, across: Transitions, before: Floats) -> None:
    """Follow each vertex from where it was [n, 2], straight to where it is, over the borders of charts."""
    for v in range(len(seamless.x)):
        if seamless.freedom[v] == FIXED:
            continue
        px, py = before[v]
        qx, qy = seamless.x[v]
        chart, turn, sx, sy, _, _ = follow(seamless.chart[v], px, py, qx, qy, seamless.glued, across)
        if chart == seamless.chart[v]:
            continue
        x, y = turned(qx, qy, turn)
        seamless.x[v, 0], seamless.x[v, 1] = x + sx, y + sy
        seamless.chart[v] = chart
        if turn % 2 == 1 and seamless.freedom[v] != FREE:
            seamless.freedom[v] = COLUMN + ROW - seamless.freedom[v]
        back = (4 - turn) % 4
        for i in range(seamless.star_start[v], seamless.star_start[v + 1]):
            f, k = seamless.star[i] // 3, seamless.star[i] % 3
            # the inverse of the move, before the frame change from the old chart
            seamless.turn[f, k] = (seamless.turn[f, k] + back) % 4
            dx, dy = turned(float(sx), float(sy), seamless.turn[f, k])
            seamless.shift[f, k, 0] -= int(dx)
            seamless.shift[f, k, 1] -= int(dy)


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
