"""Relaxation of a seamless map from coarse to fine.

Fewer vertices know how to spread a limb that a map of all vertices has squeezed into a point, and move over long ways
in a few steps. So the map is thinned out first; then the vertices come back round by round, and whenever they have
become twice as many the whole map is relaxed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Floats, Ints, kernel

from .cones import move_tips
from .energy import Reference, reference_of, total_energy
from .frames import after, inverse
from .insertion import insert
from .newton import newton_step
from .quads import Quads
from .seamless import FIXED, SeamlessMap, Transitions, frame_of, seamless_map, stars, transitions
from .surface import edges_of
from .sweep import sweep
from .thinning import Round, thinned
from .wander import rehome

_POWER = 2
_GROWTH = 1.8  # of the vertices from one relaxation to the next
_SWEEPS = 2
_MOST_STEPS, _TIRED = 20, 5e-3  # stop when a step lowers the energy by less than this share
_MOST_MOVES = 5  # of a tip, by an edge each
_LEAST_CG_STEPS, _MOST_CG_STEPS, _SHORT_STEP = 10, 80, 0.3


def relaxed(quads: Quads) -> SeamlessMap:
    """The map of the quads, with areas evened out and shear taken away as far as its cones allow."""
    start, across = seamless_map(quads), transitions(quads.glued)
    rounds, order, merged = thinned(start, quads.surface.V)
    V = quads.surface.V[order]
    gathered = _gathered(quads.surface.V, quads.surface.F, order, merged, rounds)
    whole = start._replace(
        x=start.x[order], chart=start.chart[order], freedom=start.freedom[order], moved=start.moved[order]
    )
    count = done = 0
    for each, areas in zip(rounds[::-1], gathered[::-1], strict=True):
        level = _level(whole, each)
        reference = reference_of(V, each.F, areas, len(quads.glued), _POWER)
        if count:
            insert(level, reference, across, merged, count)
        count = each.vertices
        if count > _GROWTH * done or each is rounds[0]:
            _relax(level, reference, across)
            done = count
    _place_tips(level, reference, across)
    result = seamless_map(quads)
    if not total_energy(level, reference) < np.inf:
        return result  # a vertex found no place: the map of the quads has no fold
    for name in ("x", "chart", "freedom", "moved"):
        getattr(result, name)[order] = getattr(level, name)
    return result._replace(turn=level.turn, shift=level.shift)


def _level(whole: SeamlessMap, each: Round) -> SeamlessMap:
    """The map on the vertices of one round; their places are shared with all others."""
    start, star = stars(each.F, each.vertices)
    turn, shift = each.turn.copy(), each.shift.copy()
    level = whole._replace(
        F=each.F,
        turn=turn,
        shift=shift,
        frame=whole.frame[:0],
        x=whole.x[: each.vertices],
        chart=whole.chart[: each.vertices],
        freedom=whole.freedom[: each.vertices],
        moved=whole.moved[: each.vertices],
        star_start=start,
        star=star,
    )
    _catch_up(level)
    return level


@kernel
def _catch_up(level: SeamlessMap) -> None:
    """Tell the triangles of the frames that vertices have taken since the map was thinned out."""
    for f in range(len(level.F)):
        for k in range(3):
            moved = level.moved[level.F[f, k]]
            back = inverse((moved[0], moved[1], moved[2]))
            level.turn[f, k], level.shift[f, k, 0], level.shift[f, k, 1] = after(back, frame_of(level, f, k))


def _gathered(
    V: Floats, F: Ints, order: NDArray[np.int64], merged: NDArray[np.int64], rounds: list[Round]
) -> list[NDArray[np.float64]]:
    """Area that the vertices of each round stand for [m^2]."""
    corners = V[F]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    current = np.asarray(np.bincount(F.ravel(), np.repeat(areas / 3, 3), len(V))[order], dtype=np.float64)
    result: list[NDArray[np.float64]] = [current]
    for each in rounds[1:]:
        kept = current[: each.vertices].copy()
        np.add.at(kept, merged[each.vertices : len(current)], current[each.vertices :])
        current = kept
        result.append(current)
    return result


def _place_tips(level: SeamlessMap, reference: Reference, across: Transitions) -> None:
    """Move the tips of cones to better places, and the map after them."""
    tips = np.flatnonzero(level.freedom == FIXED)
    for i in range(_MOST_MOVES):
        tips = move_tips(level, reference, across, tips)
        if not len(tips):
            break
        _sweep(level, reference, across, i % 2 == 0)
    _relax(level, reference, across)


def _relax(level: SeamlessMap, reference: Reference, across: Transitions) -> None:
    """Sweeps, then Newton steps until they tire."""
    edges = edges_of(level.F)
    for i in range(_SWEEPS):
        _sweep(level, reference, across, i % 2 == 0)
    cg_steps = _LEAST_CG_STEPS
    for i in range(_MOST_STEPS):
        fall, step = newton_step(level, reference, edges, across, cg_steps)
        if step < 1:
            fall += _sweep(level, reference, across, i % 2 == 0)
        if fall < _TIRED * total_energy(level, reference):
            return
        if step >= 1:
            cg_steps = min(2 * cg_steps, _MOST_CG_STEPS)
        elif step < _SHORT_STEP:
            cg_steps = max(cg_steps // 2, _LEAST_CG_STEPS)


def _sweep(level: SeamlessMap, reference: Reference, across: Transitions, backwards: bool) -> float:
    before = level.x.copy()
    fall = sweep(level, reference, backwards)
    rehome(level, across, before)
    return fall
