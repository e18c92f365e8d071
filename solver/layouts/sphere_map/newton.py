"""Global inexact Newton method: all vertices of a level move at once along a conjugate-gradient direction.

The Hessian is made positive semidefinite (`hessian`), and the step ends short of the first fold.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, Ints32, kernel
from ..conjugate_gradients import solve
from .energy import Reference, total_energy
from .hessian import assemble
from .level import Level
from .vectors import combine, cross, dot, row, set_row, subtract, tangent_frame, unit

LONGEST_STEP = 0.7  # [rad]
FURTHER, SHORTER = 1.6, 0.6  # factors from one trial step to the next
MOST_TRIALS = 14
CG_TOLERANCE = 0.03


def newton_step(level: Level, S: Floats, reference: Reference, cg_steps: int) -> tuple[float, float]:
    """Move S by one Newton step in place, its direction found by up to `cg_steps` steps of conjugate gradients.

    Returns
    -------
    float
        By how much the energy fell; 0 where no step lowers it.
    float
        The step's length, 1 for a whole Newton step.
    """
    gradient, diagonal, blocks = np.empty((len(S), 2)), np.empty((len(S), 3)), np.empty((len(level.ends), 4))
    x, y = tangents(S)
    energy = assemble(level, S, reference, x, y, gradient, diagonal, blocks)
    step = solve(level.ends, diagonal, blocks, gradient, cg_steps, CG_TOLERANCE)
    if not np.sum(gradient * step) < 0.0:
        return 0.0, 0.0
    velocity = step[:, :1] * x + step[:, 1:] * y
    longest = float(np.sqrt(np.max(np.sum(step * step, axis=1))))
    bound = min(0.9 * _time_of_first_fold(level.tail, S, velocity), LONGEST_STEP / longest)
    expected = -0.5 * float(np.sum(gradient * step))
    t, lower = _search(energy, expected, bound, level.tail, S, velocity, reference)
    return energy - lower, t


def _search(
    energy: float, expected: float, bound: float, tail: Ints32, S: Floats, velocity: Floats, reference: Reference
) -> tuple[float, float]:
    """Move S along `velocity`, by less than `bound`, to about the least energy; return the step and that energy.

    A whole step that falls further than `expected` is lengthened, another shortened, for as long as that helps.
    """
    best, trial = np.empty_like(S), np.empty_like(S)
    t = min(1.0, bound)
    lower = _energy_at(t, tail, S, velocity, reference, best)
    factor = FURTHER if energy - lower > t * expected else SHORTER
    for _ in range(MOST_TRIALS):
        if factor * t > bound:
            break
        next_lower = _energy_at(factor * t, tail, S, velocity, reference, trial)
        if lower < energy and not next_lower < lower:
            break
        t, lower, best, trial = factor * t, next_lower, trial, best
    if not lower < energy:
        return 0.0, energy
    S[:] = best
    return t, lower


@kernel
def tangents(S: Floats) -> tuple[Floats, Floats]:
    """Two orthonormal tangents at each of the unit vectors S, each of shape [n, 3]."""
    x, y = np.empty_like(S), np.empty_like(S)
    for v in range(len(S)):
        first, second = tangent_frame(row(S, v))
        set_row(x, v, first)
        set_row(y, v, second)
    return x, y


@kernel
def _energy_at(t: float, tail: Ints32, S: Floats, velocity: Floats, reference: Reference, moved: Floats) -> float:
    """Energy a step t along `velocity`; fills the positions there."""
    for v in range(len(S)):
        set_row(moved, v, unit(combine(1.0, row(S, v), t, row(velocity, v))))
    return total_energy(tail, moved, reference)


@kernel
def _time_of_first_fold(tail: Ints32, S: Floats, velocity: Floats) -> float:
    """Lower bound on the first time t in (0, 1.2] at which det(a + t a', b + t b', c + t c') of a triangle is zero.

    Infinite where no triangle folds by then.
    """
    horizon = 1.2
    first = np.inf
    for f in range(len(tail) // 3):
        i, j, k = tail[3 * f], tail[3 * f + 1], tail[3 * f + 2]
        p, dp = row(S, i), row(velocity, i)
        e, g = subtract(row(S, j), p), subtract(row(S, k), p)
        de, dg = subtract(row(velocity, j), dp), subtract(row(velocity, k), dp)
        n0, n2 = cross(e, g), cross(de, dg)
        n1 = combine(1.0, cross(de, g), 1.0, cross(e, dg))
        c0, c3 = dot(p, n0), dot(dp, n2)
        c1, c2 = dot(dp, n0) + dot(p, n1), dot(dp, n1) + dot(p, n2)
        if abs(c1) * horizon + abs(c2) * horizon**2 + abs(c3) * horizon**3 < 0.9 * c0:
            continue
        low = high = 0.0
        for s in range(1, 25):
            high = horizon * s / 24
            if c0 + high * (c1 + high * (c2 + high * c3)) <= 0.0:
                for _ in range(12):
                    middle = 0.5 * (low + high)
                    if c0 + middle * (c1 + middle * (c2 + middle * c3)) > 0.0:
                        low = middle
                    else:
                        high = middle
                first = min(first, low)
                break
            low = high
    return first
