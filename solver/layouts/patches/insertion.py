"""Putting an inner vertex where no triangle of its star is folded, and into the chart that lies there."""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, kernel
from .energy import Reference
from .frames import after, inverse, turned
from .seamless import FIXED, SeamlessMap, Transitions, frame_of
from .sweep import star_energy
from .wander import follow


@kernel
def place(seamless: SeamlessMap, reference: Reference, u: int, v: int, star: Floats, degree: int) -> None:
    """Put u, in the frame that it begins with, on a way from v, where its star's energy is least."""
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
            energy = star_energy(star, degree, px, py, reference.power)
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
def settle(seamless: SeamlessMap, across: Transitions, u: int) -> None:
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
