"""Relaxing a seamless map: all its vertices move at once, and stop short of the first fold.

Relaxation of a seamless map: all of its vertices at once, then the tips of its cones, then all once more.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, kernel
from ..conjugate_gradients import solve
from .cones import move_tips
from .energy import Reference, assemble, reference_of, sweep, total_energy
from .seamless import FIXED, SeamlessMap, Transitions, corner_place, rehome, transitions, turned
from .surface import Edges, edges_of

_CG_TOLERANCE = 0.03
_LONGEST_STEP = 0.5  # of a chart
_FURTHER, _SHORTER = 1.6, 0.6
_MOST_TRIALS = 12


def newton_step(
    seamless: SeamlessMap, reference: Reference, edges: Edges, across: Transitions, cg_steps: int
) -> tuple[float, float]:
    """Move the map by one Newton step in place; return by how much the energy fell, and the step's length.

    Whole steps have length 1; 0 where no step lowers the energy.
    """
    count = len(seamless.x)
    gradient, diagonal, blocks = np.empty((count, 2)), np.empty((count, 3)), np.empty((len(edges.ends), 4))
    energy = total_energy(seamless, reference)
    assemble(seamless, reference, edges.of, edges.ends, gradient, diagonal, blocks)
    step = solve(edges.ends.astype(np.int32), diagonal, blocks, gradient, cg_steps, _CG_TOLERANCE)
    slope = float((gradient * step).sum())
    if not slope < 0:
        return 0.0, 0.0
    before = seamless.x.copy()
    longest = float(np.sqrt((step * step).sum(axis=1).max()))
    bound = min(0.9 * _first_fold(seamless, step), _LONGEST_STEP / longest)
    t = min(1.0, bound)
    lower = _energy_at(seamless, reference, before, step, t)
    factor = _FURTHER if energy - lower > -0.5 * t * slope else _SHORTER
    best = t
    for _ in range(_MOST_TRIALS):
        if factor * t > bound:
            break
        t *= factor
        trial = _energy_at(seamless, reference, before, step, t)
        if lower < energy and not trial < lower:
            break
        best, lower = t, trial
    if not lower < energy:
        seamless.x[:] = before
        return 0.0, 0.0
    seamless.x[:] = before + best * step
    rehome(seamless, across, before)
    return energy - lower, best


def _energy_at(seamless: SeamlessMap, reference: Reference, before: Floats, step: Floats, t: float) -> float:
    seamless.x[:] = before + t * step
    return total_energy(seamless, reference)


@kernel
def _first_fold(seamless: SeamlessMap, step: Floats) -> float:
    """The first time at which a triangle has no area, if its corners move by `step` in a unit of time."""
    first = np.inf
    x, d = np.empty((3, 2)), np.empty((3, 2))
    for f in range(len(seamless.F)):
        for k in range(3):
            v = seamless.F[f, k]
            x[k, 0], x[k, 1] = corner_place(seamless, f, k)
            d[k, 0], d[k, 1] = turned(step[v, 0], step[v, 1], seamless.turn[f, k])
        ux, uy, vx, vy = x[1, 0] - x[0, 0], x[1, 1] - x[0, 1], x[2, 0] - x[0, 0], x[2, 1] - x[0, 1]
        px, py, qx, qy = d[1, 0] - d[0, 0], d[1, 1] - d[0, 1], d[2, 0] - d[0, 0], d[2, 1] - d[0, 1]
        c = ux * vy - uy * vx
        b = ux * qy - uy * qx + px * vy - py * vx
        a = px * qy - py * qx
        # the least positive root of a t^2 + b t + c, with c > 0
        root = b * b - 4 * a * c
        if root < 0 or (a >= 0 and b >= 0):
            continue
        t = 2 * c / (-b + np.sqrt(root))
        if t > 0:
            first = min(first, t)
    return first


_POWER = 2
_SWEEPS = 2
_MOST_STEPS = 30
_ROUGH, _FINE = 5e-3, 2e-3  # before the tips move and after: stop when a step saves less than this share of the energy
_MOST_MOVES = 5  # of a tip, by an edge each
_LEAST_CG_STEPS, _MOST_CG_STEPS, _SHORT_STEP = 40, 200, 0.3


def relax(V: Floats, seamless: SeamlessMap) -> None:
    """Even out areas and take away shear, in place, as far as the map's cones allow; V [n, 3] are its vertices [m].

    Cells are small and flat enough for that from where the quads lie; no step folds a triangle.
    """
    across = transitions(seamless.glued)
    reference = reference_of(V, seamless.F, len(seamless.glued), _POWER)
    _relax(seamless, reference, across, _ROUGH)
    _place_tips(seamless, reference, across)


def _place_tips(seamless: SeamlessMap, reference: Reference, across: Transitions) -> None:
    """Move the tips of cones to better places, and the map after them."""
    tips = np.flatnonzero(seamless.freedom == FIXED)
    for i in range(_MOST_MOVES):
        tips = move_tips(seamless, reference, across, tips)
        if not len(tips):
            break
        _sweep(seamless, reference, across, i % 2 == 0)
    _relax(seamless, reference, across, _FINE)


def _relax(seamless: SeamlessMap, reference: Reference, across: Transitions, tired: float) -> None:
    """Sweeps, then Newton steps until they tire."""
    edges = edges_of(seamless.F)
    for i in range(_SWEEPS):
        _sweep(seamless, reference, across, i % 2 == 0)
    cg_steps = _LEAST_CG_STEPS
    for i in range(_MOST_STEPS):
        fall, step = newton_step(seamless, reference, edges, across, cg_steps)
        if step < 1:
            fall += _sweep(seamless, reference, across, i % 2 == 0)
        if fall < tired * total_energy(seamless, reference):
            return
        if step >= 1:
            cg_steps = min(2 * cg_steps, _MOST_CG_STEPS)
        elif step < _SHORT_STEP:
            cg_steps = max(cg_steps // 2, _LEAST_CG_STEPS)


def _sweep(seamless: SeamlessMap, reference: Reference, across: Transitions, backwards: bool) -> float:
    before = seamless.x.copy()
    fall = sweep(seamless, reference, backwards)
    rehome(seamless, across, before)
    return fall
