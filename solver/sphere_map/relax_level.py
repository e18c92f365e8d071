"""Bringing one level to the minimum of its energy: sweeps first, then Newton steps."""

from __future__ import annotations

import numpy as np

from .energy import Reference, total_energy
from .level import Level
from .newton import newton_step
from .relaxation import sweep
from .vectors import Floats

MOST_SWEEPS, TIRED_SWEEP = 5, 0.1  # stop when a sweep lowers the energy by less than this share
MOST_NEWTON_STEPS, TIRED_NEWTON = 20, 1e-2  # stop when two steps in a row do
EXPLODED = 1e5 * 4 * np.pi  # energy of a level that is stuck: start over from the sweeps
MOST_ROUNDS = 4


def relax_level(level: Level, S: Floats, reference: Reference) -> None:
    """Lower the energy of a level in place: sweeps until they tire, then Newton steps with a sweep after each."""
    for _ in range(MOST_ROUNDS):
        _sweep_until_tired(level, S, reference)
        _newton_until_tired(level, S, reference)
        if total_energy(level.tail, S, reference) < EXPLODED:
            return


def _sweep_until_tired(level: Level, S: Floats, reference: Reference) -> None:
    for i in range(MOST_SWEEPS):
        fall = sweep(level.star_start, level.star, level.tail, S, reference, i % 2 == 0)
        if fall < TIRED_SWEEP * total_energy(level.tail, S, reference):
            return


def _newton_until_tired(level: Level, S: Floats, reference: Reference) -> None:
    slow = 0
    for i in range(MOST_NEWTON_STEPS):
        fall = newton_step(level, S, reference)
        fall += sweep(level.star_start, level.star, level.tail, S, reference, i % 2 == 0)
        slow = slow + 1 if fall < TIRED_NEWTON * total_energy(level.tail, S, reference) else 0
        if slow == 2:
            return
