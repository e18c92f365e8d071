"""A low-pass filter on contact forces: moving geoms load the surface as they hit it, resting ones ever more steadily.

MuJoCo's contact forces flicker from step to step even under a geom at rest, and would keep the surface moving. So the
longer a geom stays in its place, the slower the filtered force g follows the contact force f:
g' = w^2 d + 2 w (f - g), d' = f - g, with w falling as one over that time. The deficit d [N s] is the impulse that the
surface has not received yet: nothing is lost, a constant force passes unchanged, and noise is averaged. The filter
works texel by texel, so that it smooths places as well as amounts.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints, kernel
from ripple_sim.solver.waves.load import add_up_by

from .texel_forces import FilteredForces, TexelForces

# A hit is over within this time [s]; until then the surface receives every force as it is.
ONSET = 0.1
# A geom that has not touched for this long has left [s]. Contacts of a geom at rest flicker from step to step.
_LEFT = 0.02
# The filter's frequency is _FOLLOW over the time for which the geom has stayed, but at least _SLOWEST [1/s].
_FOLLOW, _SLOWEST = 2.0, 1.0

# The contact of one geom with the target over time. Its place is that of its contacts, smoothed.
CONTACT_STATE = np.dtype(
    [
        ("active", np.bool_),  # the geom touches, has lost touch only now, or has a deficit
        ("in_deficit", np.bool_),
        ("absent", np.float64),  # how long it has not touched [s]
        ("settled", np.float64),  # how long it has stayed in its place [s]
        ("place", np.float64, 3),  # [m]
        ("anchor", np.float64, 3),  # where the place was when it began to stay [m]
        ("first", np.int64),  # its texels among the `FilteredForces`
        ("last", np.int64),
    ]
)


@kernel
def low_pass(
    states: np.ndarray, before: FilteredForces, present: TexelForces, dt: float, scratch: Ints
) -> tuple[FilteredForces, Floats, bool]:
    """Filter the contact forces of a step.

    Parameters
    ----------
    states : CONTACT_STATE [ngeom]
        Updated.
    before : FilteredForces
        Those of the step before.
    present : TexelForces
    dt : float
        Time step [s].
    scratch : int64 [C n n]
        See `slot_scratch`.

    Returns
    -------
    filtered : FilteredForces
    given : float64 [k]
        Forces on its texels over this step [N].
    over : bool
        Whether all geoms have left, and there is no deficit.
    """
    room = len(before.texels) + len(present.texels)
    texels, given, forces, deficits = np.empty(room, np.int64), np.empty(room), np.empty(room), np.empty(room)
    count, i, over = 0, 0, True
    for geom in range(len(states)):
        state, rows = states[geom], slice(0, 0)
        if i < len(present.geoms) and present.geoms[i] == geom:
            rows = slice(present.begins[i], present.begins[i + 1])
            _touch(state, present.middles[i], present.place_radii[i], min(1.0, 2 * dt / ONSET))
            i += 1
        elif state.active:
            _miss(state, dt)
        else:
            continue
        old = slice(state.first, state.last)
        mine = FilteredForces(before.texels[old], before.forces[old], before.deficits[old])
        at, now, filtered, deficit = _filter(state, mine, present.texels[rows], present.forces[rows], dt, scratch)
        state.in_deficit = deficit.any()
        state.active = state.in_deficit or state.absent <= _LEFT
        if not state.active:
            state.settled = 0.0
        over = over and not state.active
        state.first, state.last = count, count + len(at)
        count += len(at)
        new = slice(state.first, state.last)
        texels[new], given[new], forces[new], deficits[new] = at, now, filtered, deficit
    return FilteredForces(texels[:count], forces[:count], deficits[:count]), given[:count], over


@kernel
def _touch(state: Any, middle: Floats, place_radius: float, pace: float) -> None:
    """Follow the geom's smoothed place; it settles anew where that is farther than a radius [m] from its anchor."""
    if not state.active or state.absent > _LEFT:
        state.place[:], state.anchor[:] = middle, middle
    state.absent = 0.0
    distance2 = 0.0
    for k in range(3):
        state.place[k] += pace * (middle[k] - state.place[k])
        distance2 += (state.place[k] - state.anchor[k]) ** 2
    if distance2 > place_radius**2:
        state.anchor[:] = state.place
        state.settled = 0.0


@kernel
def _miss(state: Any, dt: float) -> None:
    """Count the time without touch; a geom that has just left settles anew."""
    was_here = state.absent <= _LEFT
    state.absent += dt
    if was_here and state.absent > _LEFT:
        state.settled = 0.0


@kernel
def _filter(
    state: Any, before: FilteredForces, texels: Ints, forces: Floats, dt: float, scratch: Ints
) -> tuple[Ints, Floats, Floats, Floats]:
    """Texels of a geom, forces given there in this step [N], and filtered forces [N] and deficits [N s] after it."""
    left = ONSET - state.settled
    state.settled += dt
    if left > 0 and not state.in_deficit:
        return texels, forces, forces, np.zeros(len(forces))
    at, (filtered, deficit, present) = _joined(before, texels, forces, scratch)
    given = np.empty(len(at))
    frequency = min(max(_FOLLOW / state.settled, _SLOWEST), 0.5 / dt)
    for i in range(len(at)):
        if left > 0:
            # an old deficit is paid in even parts until the onset is over
            paid = min(1.0, dt / left) * deficit[i]
            given[i], filtered[i], deficit[i] = present[i] + paid / dt, present[i], deficit[i] - paid
        else:
            filtered[i] += dt * (frequency**2 * deficit[i] + 2 * frequency * (present[i] - filtered[i]))
            given[i], deficit[i] = filtered[i], deficit[i] + dt * (present[i] - filtered[i])
    return at, given, filtered, deficit


@kernel
def _joined(before: FilteredForces, texels: Ints, forces: Floats, scratch: Ints) -> tuple[Ints, Floats]:
    """Texels with a filtered force, a deficit or a present force, and these three there, [3, k]."""
    room = len(before.texels) + len(texels)
    at, values, count = np.empty(room, np.int64), np.zeros((3, room)), 0
    for i in range(len(before.texels)):
        if before.forces[i] != 0 or before.deficits[i] != 0:
            at[count], values[0, count], values[1, count] = before.texels[i], before.forces[i], before.deficits[i]
            count += 1
    for i in range(len(texels)):
        at[count], values[2, count] = texels[i], forces[i]
        count += 1
    return add_up_by(scratch, at[:count], values)
