"""Relaxation of a seamless map: all of its vertices at once, then the tips of its cones, then all once more."""

from __future__ import annotations

import numpy as np

from ...kernel import Floats
from .cones import move_tips
from .energy import Reference, reference_of, total_energy
from .relaxation import newton_step
from .seamless import FIXED, SeamlessMap, Transitions, transitions
from .surface import edges_of
from .sweep import sweep
from .wander import rehome

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
