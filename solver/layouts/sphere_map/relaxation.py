"""Gauss-Seidel relaxation: one vertex at a time takes a Newton step in its tangent plane that lowers the energy.

A step never folds a triangle, since a fold has infinite energy. Sweeps get out of states where the global Newton method
sticks (a long cigar), and remove what is rough; what is smooth is the work of `newton`.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, kernel
from .level import Level
from .star import TERMS, energy_after, expand, slopes, tangent_move
from .vectors import combine, row, set_row, tangent_frame, unit

REACH = 0.3  # longest step [rad]
ARMIJO = 1e-4


@kernel
def _descent_direction(gx: float, gy: float, hxx: float, hxy: float, hyy: float) -> tuple[float, float]:
    """Newton step -|H|^-1 g of a 2 x 2 Hessian, its eigenvalues taken by their absolute value."""
    mean, half = 0.5 * (hxx + hyy), 0.5 * (hxx - hyy)
    determinant = hxx * hyy - hxy * hxy
    if mean > 0.0 and determinant > 1e-3 * mean * mean:
        return (hxy * gy - hyy * gx) / determinant, (hxy * gx - hxx * gy) / determinant
    radius = np.sqrt(half * half + hxy * hxy)
    if radius > 0.0:
        # eigenvector of mean + radius, from the better conditioned of two formulas
        ux, uy = (half + radius, hxy) if half > 0.0 else (hxy, radius - half)
        length = np.sqrt(ux * ux + uy * uy)
        ux, uy = ux / length, uy / length
    else:
        ux, uy = 1.0, 0.0
    first, second = abs(mean + radius), abs(mean - radius)
    floor = 1e-4 * max(first, second)
    along = -(gx * ux + gy * uy) / max(first, floor)
    across = -(gy * ux - gx * uy) / max(second, floor)
    return along * ux - across * uy, along * uy + across * ux


@kernel
def relax_vertex(v: int, S: Floats, ring: Floats, shapes: Floats, degree: int, terms: Floats) -> float:
    """Move v to lower the energy of its star; return by how much it fell.

    `ring` and `shapes` are as in `star.expand`, and `terms` is room for what it fills.
    """
    p = row(S, v)
    x, y = tangent_frame(p)
    expand(p, x, y, ring, shapes, degree, terms)
    energy, gx, gy, hxx, hxy, hyy = slopes(terms, degree)
    if not energy < np.inf:
        return 0.0
    sx, sy = _descent_direction(gx, gy, hxx, hxy, hyy)
    descent = -(gx * sx + gy * sy)
    if not descent > 1e-13 * energy:
        return 0.0
    step = min(1.0, REACH / np.sqrt(sx * sx + sy * sy))
    for _ in range(14):
        move = tangent_move(step * sx, step * sy)
        lower = energy_after(move, terms, degree)
        if lower < energy - ARMIJO * step * descent:
            further = 2.0 * lower < energy  # high up a wall a Newton step is far too short
            while further:
                step *= 2.0
                ahead = tangent_move(step * sx, step * sy)
                least = energy_after(ahead, terms, degree)
                further = 2.0 * least < lower
                if least < lower:
                    move, lower = ahead, least
            set_row(S, v, unit(combine(1.0, combine(move[0], x, move[1], y), 1.0 + move[2], p)))
            return energy - lower
        step *= 0.35
    return 0.0


@kernel
def sweep(level: Level, S: Floats, shapes: Floats, backwards: bool) -> float:
    """Relax every vertex of a level once, in order or backwards; return by how much the energy fell.

    `shapes` [3 m, 4] comes from `level.star_shapes`.
    """
    count = len(level.star_start) - 1
    largest = 0
    for v in range(count):
        largest = max(largest, level.star_start[v + 1] - level.star_start[v])
    ring, terms = np.empty((largest, 3)), np.empty((largest, TERMS))
    fall = 0.0
    for i in range(count):
        v = count - 1 - i if backwards else i
        first, last = level.star_start[v], level.star_start[v + 1]
        for k in range(last - first):
            set_row(ring, k, row(S, level.ring[first + k]))
        fall += relax_vertex(v, S, ring, shapes[first:last], last - first, terms)
    return fall
