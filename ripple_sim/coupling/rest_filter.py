"""The rest filter: the surface under a geom at rest becomes still, and nothing else changes.

What flickers under a geom at rest is where it presses: MuJoCo splits its weight otherwise among the contact points of
every step. The sum of its contact forces is smooth, and passes as it is; the place is averaged over a memory that grows
while nothing changes, and is short where force or place do.

A contact that chatters is the exception: its force is averaged over some periods too. The deficit [N s] is what the
surface has yet to receive, so that nothing is lost.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints, kernel

from .contact_state import miss, touch, turn
from .texel_forces import MeanShares, TexelForces

# Shares below this are dropped from a mean.
_LEAST_SHARE = 1e-6


class _Room(NamedTuple):
    """Texels under the geoms, their new mean shares, and the shares of this step, which become forces [N]."""

    texels: Ints
    shares: Floats
    given: Floats


@kernel
def rest_filter(
    states: np.ndarray, before: MeanShares, present: TexelForces, dt: float, scratch: Ints
) -> tuple[MeanShares, Floats, bool]:
    """Filter the contact forces of a step.

    Parameters
    ----------
    states : CONTACT_STATE [ngeom]
        Updated.
    before : MeanShares
        Those of the step before.
    present : TexelForces
    dt : float
        Time step [s].
    scratch : int64 [C n n]
        See `slot_scratch`.

    Returns
    -------
    mean : MeanShares
    given : float64 [k]
        Forces on its texels over this step [N].
    over : bool
        Whether all geoms have left, and there is no deficit.
    """
    size = len(before.texels) + len(present.texels)
    room = _Room(np.empty(size, np.int64), np.empty(size), np.empty(size))
    end, row, over = 0, 0, True
    for geom in range(len(states)):
        state, begin, force = states[geom], end, 0.0
        if row < len(present.geoms) and present.geoms[row] == geom:
            for i in range(present.begins[row], present.begins[row + 1]):
                force += present.forces[i]
            row += 1
        if force != 0:
            turn(state, 1.0 if force > 0 else -1.0)
            total = state.side * touch(state, abs(force), present.middles[row - 1], present.place_radii[row - 1], dt)
            pace = dt / (dt + state.memory) if state.first < state.last else 1.0
            if pace < 1:
                end = _add_before(room, end, before, state, 1 - pace, scratch)
            end = _add_present(room, begin, end, present, row - 1, force, pace, scratch)
            state.active = True
            steady = state.side * min(state.mean, state.side * total)
        elif state.active:
            total = steady = state.side * miss(state, dt)
            for i in range(state.first, state.last):
                room.texels[end], room.shares[end], room.given[end] = before.texels[i], before.shares[i], 0.0
                end += 1
        else:
            continue
        over = over and not state.active
        state.first, state.last = begin, end
        for i in range(begin, end):
            room.given[i] = steady * room.shares[i] + (total - steady) * room.given[i]
    return MeanShares(room.texels[:end], room.shares[:end]), room.given[:end], over


# Loops only: slices and expressions of arrays take many times longer to compile. Arrays are taken out of their tuples
# before a loop: in it that would cost more than all else.
@kernel
def _add_before(room: _Room, end: int, before: MeanShares, state: Any, part: float, scratch: Ints) -> int:
    """Add the mean shares of a geom so far, as a part of the new ones; where they end."""
    (texels, shares, given), (under, old), total = room, before, 0.0
    for i in range(state.first, state.last):
        if old[i] > _LEAST_SHARE:
            total += old[i]
    fading = part / total
    for i in range(state.first, state.last):
        if old[i] > _LEAST_SHARE:
            slot = _slot(scratch, under[i], end)
            if slot == end:
                texels[slot], shares[slot], given[slot] = under[i], 0.0, 0.0
                end += 1
            shares[slot] += fading * old[i]
    return end


@kernel
def _add_present(
    room: _Room, begin: int, end: int, present: TexelForces, row: int, force: float, pace: float, scratch: Ints
) -> int:
    """Add the shares of this step, times the pace; where they end. All from `begin` on are the geom's."""
    (texels, shares, given), under, forces = room, present.texels, present.forces
    for i in range(present.begins[row], present.begins[row + 1]):
        share, slot = forces[i] / force, _slot(scratch, under[i], end)
        if slot == end:
            texels[slot], shares[slot], given[slot] = under[i], 0.0, 0.0
            end += 1
        shares[slot] += pace * share
        given[slot] += share
    for i in range(begin, end):
        scratch[texels[i]] = -1
    return end


@kernel
def _slot(scratch: Ints, texel: int, end: int) -> int:
    """Where the shares of a texel are, which is told of once for each geom: `end` if it is new."""
    if scratch[texel] < 0:
        scratch[texel] = end
    return scratch[texel]
