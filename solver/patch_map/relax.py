"""Relaxation of a seamless map, until it tires."""

from __future__ import annotations

from .energy import Reference, reference_of, total_energy
from .newton import newton_step
from .quads import Quads
from .seamless import SeamlessMap, Transitions, seamless_map, transitions
from .surface import Edges
from .sweep import sweep
from .wander import rehome

_POWERS = (1, 2)
_FIRST_SWEEPS = 3
_MOST_STEPS, _TIRED = 12, 1e-2  # stop when a step lowers the energy by less than this share
_LEAST_CG_STEPS, _MOST_CG_STEPS, _SHORT_STEP = 10, 80, 0.3


def relaxed(quads: Quads) -> SeamlessMap:
    """The map of the quads, with areas evened out and shear taken away as far as its cones allow."""
    seamless, across, edges = seamless_map(quads), transitions(quads.glued), quads.surface.edges
    for power in _POWERS:
        reference = reference_of(quads.surface, len(quads.glued), power)
        for i in range(_FIRST_SWEEPS):
            _sweep(seamless, reference, across, i % 2 == 0)
        _newton_until_tired(seamless, reference, edges, across)
    return seamless


def _newton_until_tired(seamless: SeamlessMap, reference: Reference, edges: Edges, across: Transitions) -> None:
    cg_steps = _LEAST_CG_STEPS
    for i in range(_MOST_STEPS):
        fall, step = newton_step(seamless, reference, edges, across, cg_steps)
        if step < 1:
            fall += _sweep(seamless, reference, across, i % 2 == 0)
        if fall < _TIRED * total_energy(seamless, reference):
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
