"""How bodies press on one target over time: as they hit while they move, ever more steadily once they rest.

MuJoCo's contact forces flicker from step to step also where a body lies still, and would keep the surface boiling. So
the longer a body stays in its place, the slower the force on the surface follows the contact force f:
g' = w^2 d + 2 w (f - g), d' = f - g, with w falling as one over the time. The debt d is what the surface has not got
yet [N s]: nothing is lost, a constant force comes through as it is, and noise is averaged. All this is done texel by
texel, so that places are smoothed as well as amounts.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.waves.load import add_up_by

# A hit is over within this time [s]; until then the surface feels every force as it is.
ONSET = 0.1
# A body that has not touched for this long has left [s]. Contacts of a body at rest flicker from step to step.
_LEFT = 0.02
# A body that has stayed in its place for a time t is followed with a frequency of _FOLLOW / t, [1/s] at the least.
_FOLLOW, _SLOWEST = 2.0, 1.0

# What is known of each body, by geom id. Its place is that of its contacts, smoothed.
BODY = np.dtype(
    [
        ("here", np.bool_),  # it touches, has left only now, or the surface is owed something
        ("owing", np.bool_),
        ("absent", np.float64),  # how long it has not touched [s]
        ("age", np.float64),  # how long it has stayed in its place [s]
        ("place", np.float64, 3),  # [m]
        ("anchor", np.float64, 3),  # where the place was when it began to stay [m]
        ("first", np.int64),  # its texels in `Felt`
        ("last", np.int64),
    ]
)


class Pressure(NamedTuple):
    """How bodies press on a target in a step.

    Attributes
    ----------
    others : int64 [p]
        Geom ids of the bodies, ascending.
    middles : float64 [p, 3]
        Force-weighted contact points [m].
    reaches : float64 [p]
        A body has left its place where its contact point has moved by more than this [m].
    begins : int64 [p + 1]
        Body i presses on the texels from begins[i] to begins[i + 1].
    texels : int64 [k]
        Flat texel indices.
    forces : float64 [k]
        [N].
    """

    others: NDArray[np.int64]
    middles: NDArray[np.float64]
    reaches: NDArray[np.float64]
    begins: NDArray[np.int64]
    texels: NDArray[np.int64]
    forces: NDArray[np.float64]


NO_PRESSURE = Pressure(
    np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0), np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0)
)


class Felt(NamedTuple):
    """What the surface feels of the bodies at some texels [N], and is owed there [N s]; each [k]."""

    texels: NDArray[np.int64]
    forces: NDArray[np.float64]
    owed: NDArray[np.float64]


NOTHING_FELT = Felt(np.zeros(0, np.int64), np.zeros(0), np.zeros(0))


@numba.njit(cache=True, nogil=True)
def follow(states, felt, pressure, dt, scratch):
    """Smooth the pressure of a step.

    Parameters
    ----------
    states : BODY [ngeom]
        Updated.
    felt : Felt
        What came of the step before.
    pressure : Pressure
    dt : float
        Time step [s].
    scratch : int64 [6 N N]
        See `slot_scratch`.

    Returns
    -------
    felt : Felt
    given : float64 [k]
        Forces on its texels over this step [N].
    over : bool
        Whether all bodies have left, and nothing is owed.
    """
    room = len(felt.texels) + len(pressure.texels)
    texels, given, forces, owed = np.empty(room, np.int64), np.empty(room), np.empty(room), np.empty(room)
    count, i, over = 0, 0, True
    for geom in range(len(states)):
        body, rows = states[geom], slice(0, 0)
        if i < len(pressure.others) and pressure.others[i] == geom:
            rows = slice(pressure.begins[i], pressure.begins[i + 1])
            _touch(body, pressure.middles[i], pressure.reaches[i], min(1.0, 2 * dt / ONSET))
            i += 1
        elif body.here:
            _miss(body, dt)
        else:
            continue
        old = slice(body.first, body.last)
        present = Felt(felt.texels[old], felt.forces[old], felt.owed[old])
        at, now, felt_now, owed_now = _smooth(body, present, pressure.texels[rows], pressure.forces[rows], dt, scratch)
        body.owing = owed_now.any()
        body.here = body.owing or body.absent <= _LEFT
        if not body.here:
            body.age = 0.0
        over = over and not body.here
        body.first, body.last = count, count + len(at)
        count += len(at)
        new = slice(body.first, body.last)
        texels[new], given[new], forces[new], owed[new] = at, now, felt_now, owed_now
    return Felt(texels[:count], forces[:count], owed[:count]), given[:count], over


@numba.njit(cache=True, nogil=True)
def _touch(body, middle, reach, pace):
    """Follow the body's smoothed place; all begins anew where that is farther than `reach` [m] from its start."""
    if not body.here or body.absent > _LEFT:
        body.place[:], body.anchor[:] = middle, middle
    body.absent = 0.0
    distance2 = 0.0
    for k in range(3):
        body.place[k] += pace * (middle[k] - body.place[k])
        distance2 += (body.place[k] - body.anchor[k]) ** 2
    if distance2 > reach**2:
        body.anchor[:] = body.place
        body.age = 0.0


@numba.njit(cache=True, nogil=True)
def _miss(body, dt):
    """All begins anew for a body that has left just now."""
    touched = body.absent <= _LEFT
    body.absent += dt
    if touched and body.absent > _LEFT:
        body.age = 0.0


@numba.njit(cache=True, nogil=True)
def _smooth(body, felt, texels, forces, dt, scratch):
    """Texels of a body, forces that are given there in this step, and what is felt and owed there after it."""
    left = ONSET - body.age
    body.age += dt
    if left > 0 and not body.owing:
        return texels, forces, forces, np.zeros(len(forces))
    at, (feels, owed, present) = _joined(felt, texels, forces, scratch)
    given = np.empty(len(at))
    pace = min(max(_FOLLOW / body.age, _SLOWEST), 0.5 / dt)
    for i in range(len(at)):
        if left > 0:
            # what is owed from before is paid in even parts until the onset is over
            paid = min(1.0, dt / left) * owed[i]
            given[i], feels[i], owed[i] = present[i] + paid / dt, present[i], owed[i] - paid
        else:
            feels[i] += dt * (pace**2 * owed[i] + 2 * pace * (present[i] - feels[i]))
            given[i], owed[i] = feels[i], owed[i] + dt * (present[i] - feels[i])
    return at, given, feels, owed


@numba.njit(cache=True, nogil=True)
def _joined(felt, texels, forces, scratch):
    """Texels where something is felt, owed or pressing, and these three there, [3, k]."""
    room = len(felt.texels) + len(texels)
    at, values, count = np.empty(room, np.int64), np.zeros((3, room)), 0
    for i in range(len(felt.texels)):
        if felt.forces[i] != 0 or felt.owed[i] != 0:
            at[count], values[0, count], values[1, count] = felt.texels[i], felt.forces[i], felt.owed[i]
            count += 1
    for i in range(len(texels)):
        at[count], values[2, count] = texels[i], forces[i]
        count += 1
    return add_up_by(scratch, at[:count], values)
