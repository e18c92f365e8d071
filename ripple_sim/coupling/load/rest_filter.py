"""The rest filter: the surface under a geom at rest becomes still, and nothing else changes.

What flickers under a geom at rest is where it presses: MuJoCo splits its weight otherwise among the contact points of
every step. The sum of its contact forces is smooth, and passes as it is; the place is averaged over a memory that grows
while nothing changes, and is short where force or place do.

A contact that chatters is the exception: its force is averaged over some periods too. The deficit [N s] is what the
surface has yet to receive, so that nothing is lost.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints, kernel
from ripple_sim.solver.waves.load import add_up_by

from .contact_state import miss, touch, turn
from .texel_forces import MeanShares, TexelForces

# Shares below this are dropped from a mean.
_LEAST_SHARE = 1e-6


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
    room = len(before.texels) + len(present.texels)
    texels, given, shares = np.empty(room, np.int64), np.empty(room), np.empty(room)
    count, i, over = 0, 0, True
    for geom in range(len(states)):
        state, rows, force = states[geom], slice(0, 0), 0.0
        if i < len(present.geoms) and present.geoms[i] == geom:
            rows = slice(present.begins[i], present.begins[i + 1])
            force = present.forces[rows].sum()
            i += 1
        old = slice(state.first, state.last)
        mean, now = MeanShares(before.texels[old], before.shares[old]), np.zeros(0)
        if force != 0:
            turn(state, 1.0 if force > 0 else -1.0)
            total = state.side * touch(state, abs(force), present.middles[i - 1], present.place_radii[i - 1], dt)
            mean, now = _mean_shares(state, mean, present.texels[rows], present.forces[rows] / force, dt, scratch)
            state.active = True
        elif state.active:
            total = state.side * miss(state, dt)
        else:
            continue
        over = over and not state.active
        state.first, state.last = count, count + len(mean.texels)
        count = state.last
        new = slice(state.first, state.last)
        texels[new], shares[new] = mean.texels, mean.shares
        steady = state.side * min(state.mean, state.side * total) if len(now) else total
        given[new] = steady * mean.shares
        if len(now):
            given[new] += (total - steady) * now
    return MeanShares(texels[:count], shares[:count]), given[:count], over


@kernel
def _mean_shares(
    state: Any, before: MeanShares, texels: Ints, shares: Floats, dt: float, scratch: Ints
) -> tuple[MeanShares, Floats]:
    """Mean shares of a geom's texels in its force, over its memory, and those of this step, at the same texels."""
    pace = dt / (dt + state.memory)
    if pace == 1 or not len(before.texels):
        return MeanShares(texels, shares), shares
    room = len(before.texels) + len(texels)
    at, values, count = np.empty(room, np.int64), np.zeros((2, room)), 0
    for i in range(len(before.texels)):
        if before.shares[i] > _LEAST_SHARE:
            at[count], values[0, count] = before.texels[i], before.shares[i]
            count += 1
    fading = (1 - pace) / values[0, :count].sum()
    for i in range(count):
        values[0, i] *= fading
    for i in range(len(texels)):
        at[count + i], values[0, count + i], values[1, count + i] = texels[i], pace * shares[i], shares[i]
    count += len(texels)
    at, sums = add_up_by(scratch, at[:count], values[:, :count])
    return MeanShares(at, sums[0]), sums[1]
