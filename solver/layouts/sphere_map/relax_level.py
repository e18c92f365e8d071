"""Bringing one level to the minimum of its energy: sweeps first, then Newton steps.

Far from the minimum a Newton step is cut short by the steepest of the energy's walls, wherever it stands, and an exact
direction is wasted. So conjugate gradients start with few steps, and get more once whole Newton steps succeed, and
after a step cut short a sweep clears the spots that were in the way.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats
from .energy import Reference, total_energy
from .level import Level, star_shapes
from .newton import newton_step
from .relaxation import sweep

MOST_SWEEPS, TIRED_SWEEP = 5, 0.1  # stop when a sweep lowers the energy by less than this share
MOST_NEWTON_STEPS, TIRED_NEWTON = 20, 5e-3  # stop when two steps in a row do
LARGE, TIRED_LARGE = 8000, 1.5e-2  # vertices of a level that is content with less
LEAST_CG_STEPS, MOST_CG_STEPS = 10, 60
SHORT_STEP = 0.3  # a Newton step cut to less than this asks for fewer steps of conjugate gradients
EXPLODED = 1e5 * 4 * np.pi  # energy of a level that is stuck: start over from the sweeps
MOST_ROUNDS = 4


def relax_level(level: Level, S: Floats, reference: Reference) -> None:
    """Lower the energy of a level in place: sweeps until they tire, then Newton steps."""
    shapes = star_shapes(level.star, reference)
    for _ in range(MOST_ROUNDS):
        _sweep_until_tired(level, S, reference, shapes)
        _newton_until_tired(level, S, reference, shapes)
        if total_energy(level.tail, S, reference) < EXPLODED:
            return


def _sweep_until_tired(level: Level, S: Floats, reference: Reference, shapes: Floats) -> None:
    for i in range(MOST_SWEEPS):
        fall = sweep(level, S, shapes, i % 2 == 0)
        if fall < TIRED_SWEEP * total_energy(level.tail, S, reference):
            return


def _newton_until_tired(level: Level, S: Floats, reference: Reference, shapes: Floats) -> None:
    tired = TIRED_NEWTON if len(S) < LARGE else TIRED_LARGE
    cg_steps, slow = LEAST_CG_STEPS, 0
    for i in range(MOST_NEWTON_STEPS):
        fall, step = newton_step(level, S, reference, cg_steps)
        if step < 1.0:
            fall += sweep(level, S, shapes, i % 2 == 0)
        slow = slow + 1 if fall < tired * total_energy(level.tail, S, reference) else 0
        if slow == 2:
            return
        if step >= 1.0:
            cg_steps = min(2 * cg_steps, MOST_CG_STEPS)
        elif step < SHORT_STEP:
            cg_steps = max(cg_steps // 2, LEAST_CG_STEPS)
