"""The state of one contact under the rest filter, and how a physics step changes it.

A contact is in one of five states:

- **Onset**: it has touched for less than `_ONSET_TIME`. Nothing is averaged.
- **Steady**: it touches without a break. Its force passes as it is, and its place is averaged.
- **Chattering**: it opens and closes again within a few steps. Its force is averaged too.
- **Open**: it has lost touch a moment ago, and may close again.
- **Gone**: it has been open for longer than `_GONE_TIME`. The surface receives the deficit, and
  then the contact is inactive.

A geom on stiff, springy contacts chatters: contact opens for a step and closes again, at the
natural frequency of the contact's spring, and the force jumps between zero and twice the weight.

The deficit [N s] is the impulse that averaging has held back: the surface receives it later, so
that nothing is lost. The prepaid impulse [N s] is what the surface has received in the pulse of a
hit before MuJoCo's contact gives it: the contact's first forces pay for it.

All times are for time steps of at most `TIME_STEP` and contacts with MuJoCo's default time
constant; the rest filter scales them for others.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from ripple_sim.solver.kernel import Floats, kernel, shared

# The times below hold for time steps of at most this length, MuJoCo's default [s].
TIME_STEP = 0.002
# They hold for this time constant of a contact, MuJoCo's default [s].
DEFAULT_TIME_CONSTANT = 0.02

# A first hit is over within this time [s].
_ONSET_TIME = 0.1
# A contact that is open for longer than this is gone [s]: longer than two steps.
_GONE_TIME = 0.005
# A contact chatters if it opens again within this time [s].
_CHATTER_PERIOD = 0.015
# A contact chatters no longer once it has touched without a break for this time [s]. The jitter of
# its place is averaged over the same time.
_CALM_TIME = 0.5

# The force of a chattering contact, a spring, is averaged over the spring's time constant [s].
_AVERAGING_TIME = DEFAULT_TIME_CONSTANT
# The deficit is paid within about this time [s].
_PAYING_TIME = 0.25

# The force of a steady contact changes where it differs from its mean by this share.
_FORCE_CHANGE = 0.05
# What is so many times its mean is no noise: the force of a springy contact is then a hit, and a
# distance from the mean place a move.
_OUTLIER_RATIO = 4.0

# The memory grows by this share of the time that passes.
_MEMORY_GROWTH = 0.4
# The longest memory [s]. With one of over 40 s the shares of a step of 2 ms would be lower than the
# least share that the rest filter keeps.
_LONGEST_MEMORY = 2.0
# Averaging time of the latest place [s]. The mean place is averaged over twice this time at least,
# and so over the onset.
_PLACE_MEMORY = _ONSET_TIME / 2
# Time within which the memory shortens where a contact moves [s].
_MOVE_TIME = 0.006
# The distance at which a contact moves is bounded by these shares of the place radius, from below
# where it does not chatter, and from above.
_MIN_MOVE_SHARE = 0.1
_MAX_MOVE_SHARE = 0.6

# Keeps a division by the mean force finite [N].
_MIN_FORCE = np.finfo(np.float64).tiny

# Records rather than plain rows: the fields are attributes in plain Python as well as in kernels.
CONTACT_STATE = np.dtype(
    (
        np.record,
        [
            ("active", np.bool_),  # touches, has just opened, or has a deficit
            ("absent", np.float64),  # how long it has not touched [s]
            ("age", np.float64),  # how long it has touched [s]
            ("unbroken", np.float64),  # how long it has touched since its last opening [s]
            ("chatters", np.bool_),
            ("springy", np.bool_),  # has chattered before
            ("side", np.float64),  # 1 where it pushes inwards, -1 outwards; forces count along it
            ("level", np.float64),  # its force, averaged over chatter [N]
            ("deficit", np.float64),  # impulse that the surface has yet to receive [N s]
            ("prepaid", np.float64),  # impulse that the surface has received in advance [N s]
            # averaging time of the means, short where something changes [s]
            ("memory", np.float64),
            ("mean_force", np.float64),  # [N]
            ("place", np.float64, 3),  # where it is [m]
            ("mean_place", np.float64, 3),  # [m]
            ("jitter", np.float64),  # mean distance of its contact points from its place [m]
            ("first", np.int64),  # its texels are those from `first` to `last`
            ("last", np.int64),
        ],
    )
)
# An element of an array of that dtype; type checkers do not know its fields.
ContactState: TypeAlias = Any


@shared
def is_gone(state: ContactState) -> bool:
    """Whether a contact is gone, and not open for a moment only."""
    return state.absent > _GONE_TIME


@shared
def turn(state: ContactState, side: float) -> None:
    """Count forces along another side: 1 inwards, -1 outwards. The deficit keeps its value."""
    if state.side != side:
        state.side = side
        state.deficit = state.prepaid - state.deficit
        state.prepaid = 0.0


@kernel(no_cpython_wrapper=True)
def touch(
    state: ContactState, force: float, point: Floats, place_radius: float, dt: float
) -> float:
    """Advance a touching contact by a step; return the force on the surface [N].

    Parameters
    ----------
    state : CONTACT_STATE
        Updated.
    force : float
        Amount of the contact force [N].
    point : float64 [3]
        Force-weighted contact point [m].
    place_radius : float
        The contact has left its place where its point has moved farther than this [m].
    dt : float
        Time step [s].
    """
    if not state.active or is_gone(state):
        _begin(state, force, point, place_radius)
    elif state.absent > 0:
        _close_again(state)
    state.absent = 0.0
    state.age += dt
    state.unbroken += dt
    state.chatters = state.chatters and state.unbroken < _CALM_TIME
    # a hit passes through the average of a chattering contact
    is_hit = state.chatters and force > _OUTLIER_RATIO * state.mean_force
    hit = force - state.mean_force if is_hit else 0.0
    state.level += dt / (dt + _AVERAGING_TIME) * (force - hit - state.level)
    _follow_force(state, force, dt)
    _follow_place(state, point, place_radius, dt)
    return _force_on_surface(state, force, hit, dt)


@kernel(no_cpython_wrapper=True)
def miss(state: ContactState, dt: float) -> float:
    """Advance a contact by a step [s] without touch; return the force on the surface [N]."""
    state.absent += dt
    state.unbroken += dt
    state.level -= dt / (dt + _AVERAGING_TIME) * state.level
    # a springy contact chatters from its first opening on
    state.chatters = state.springy and not is_gone(state)
    if is_gone(state):
        # no contact force will come that pays for the prepaid impulse
        state.deficit -= state.prepaid
        state.prepaid = 0.0
    force = _force_on_surface(state, 0.0, 0.0, dt)
    state.active = state.deficit != 0 or not is_gone(state)
    return force


@shared
def _begin(state: ContactState, force: float, point: Floats, place_radius: float) -> None:
    """Start the onset of a new contact."""
    state.age = 0.0
    state.unbroken = 0.0
    state.level = force
    state.mean_force = force
    state.chatters = False
    state.springy = False
    state.jitter = place_radius
    for k in range(3):
        state.place[k] = point[k]
        state.mean_place[k] = point[k]


@shared
def _close_again(state: ContactState) -> None:
    """Close a contact that was open for a moment; it chatters if it has opened before, of late."""
    if state.age > _ONSET_TIME and state.unbroken < _CHATTER_PERIOD:
        state.springy = True
    state.chatters = state.springy
    state.unbroken = 0.0


@shared
def _follow_force(state: ContactState, force: float, dt: float) -> None:
    """Let the mean force follow, and the memory end where the force changes."""
    # 1 or more where the force is as it was, 0 or less where it has changed
    if state.age < _ONSET_TIME:
        sameness = 0.0
    elif state.springy or state.unbroken < _CALM_TIME:
        sameness = _OUTLIER_RATIO - force / max(state.mean_force, _MIN_FORCE)
    else:
        allowed = max(_FORCE_CHANGE * state.mean_force, _MIN_FORCE)
        sameness = 2 - abs(force - state.mean_force) / allowed
    grown = min(state.memory + _MEMORY_GROWTH * dt, _LONGEST_MEMORY)
    state.memory = grown * min(max(sameness, 0.0), 1.0)
    latest = state.level if state.chatters else force
    state.mean_force += dt / (dt + state.memory) * (latest - state.mean_force)


@shared
def _follow_place(state: ContactState, point: Floats, place_radius: float, dt: float) -> None:
    """Let the mean place follow, and shorten the memory where the latest place has left it."""
    jump2 = 0.0  # of the contact point from its latest place [m^2]
    lag2 = 0.0  # of the mean place behind the latest one [m^2]
    for k in range(3):
        jump2 += (point[k] - state.place[k]) ** 2
        state.place[k] += dt / (dt + _PLACE_MEMORY) * (point[k] - state.place[k])
        mean_memory = max(2 * _PLACE_MEMORY, state.memory)
        state.mean_place[k] += dt / (dt + mean_memory) * (point[k] - state.mean_place[k])
        lag2 += (state.place[k] - state.mean_place[k]) ** 2
    state.jitter += dt / (dt + _CALM_TIME) * (np.sqrt(jump2) - state.jitter)
    stays_within = _MAX_MOVE_SHARE * place_radius
    if not state.springy:
        jitters = max(_OUTLIER_RATIO * state.jitter, _MIN_MOVE_SHARE * place_radius)
        stays_within = min(jitters, stays_within)
    if lag2 > stays_within**2:
        beyond = 1 - stays_within / np.sqrt(lag2)
        state.memory *= 1 - min(1.0, dt / _MOVE_TIME) * beyond


@kernel(no_cpython_wrapper=True)
def _force_on_surface(state: ContactState, force: float, hit: float, dt: float) -> float:
    """Force that the surface receives over a step [N]; keeps the books of the deficit.

    Parameters
    ----------
    state : CONTACT_STATE
        Its deficit and its prepaid impulse are updated.
    force, hit : float
        Force of the contact, and the part of it that is a hit [N].
    dt : float
        Time step [s].
    """
    repaid = min(state.prepaid / dt, force)
    state.prepaid -= dt * repaid
    force -= repaid
    received = state.level + hit if state.chatters else force
    state.deficit += dt * (force - received)
    if state.deficit != 0:
        share = dt / (dt + _PAYING_TIME)
        if is_gone(state):
            # the rest is paid in even parts
            share = min(1.0, dt / max(_AVERAGING_TIME - state.absent, dt))
        paid = share * state.deficit
        state.deficit -= paid
        received += paid / dt
    return received
