"""The rest filter: the surface under a geom at rest becomes still, and nothing else changes.

What flickers under a geom at rest is where it presses: MuJoCo splits its weight otherwise among the contact points of
every step. The sum of its contact forces is smooth, and passes as it is; the place is averaged over a memory that grows
while nothing changes, and is short where force or place do.

A contact that chatters is the exception: its force is averaged over some periods too. The deficit [N s] is what the
surface has yet to receive, so that nothing is lost. What is prepaid the surface has got before MuJoCo's contact gives
it, in the pulse of a hit: the contact's first impulses pay for it.

A geom on stiff, springy contacts chatters: contact opens for a step and closes again, at the natural frequency of the
contact's spring, and the force jumps between nothing and twice the weight.

All times are for time steps of 2 ms and contacts with MuJoCo's default time constant; longer ones make them longer.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ripple_sim.solver import Load
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel, shared

# A first hit is over within this time [s]; until then nothing is averaged.
_ONSET = 0.1
# A geom whose contact has been open for this long, and for more than a step, has left [s].
_LEFT = 0.005
# A contact chatters if it opens again within this time [s], or so many steps. It is calm again after a longer one.
_CHATTER_PERIOD, _CHATTER_STEPS, _CALM = 0.015, 4, 0.5
# The force of a chattering contact is averaged over this time, and what is then missing is given within that [s].
_AVERAGED, _PAID_WITHIN = 0.02, 0.25
# A hit: the force differs from its mean by this share in a calm contact, or is so many times as high in a springy one.
_CHANGE, _HIT = 0.05, 4.0
# The memory grows by this share of the time, up to a limit [s].
_GROWTH, _LONGEST_MEMORY = 0.4, 2.0
# Memories of the latest place and of its jitter, and the time within which the memory follows a move [s].
_PLACE_MEMORY, _JITTER_MEMORY, _FOLLOWS_WITHIN = 0.05, 0.5, 0.006
# A contact moves where it is farther from its mean place than so many times its jitter, but not less or more than these
# shares of the place's radius; a springy one, where it is farther than the latter.
_JITTERS, _LEAST_MOVE, _MOST_MOVE = 4.0, 0.1, 0.6
# Shares below this are dropped from a mean.
_LEAST_SHARE = 1e-6
_TINY = np.finfo(np.float64).tiny

# What the times above are for: a time step, and a contact's time constant [s].
_TIME_STEP, DEFAULT_TIME_CONSTANT = 0.002, 0.02

# records, so that the fields are attributes in plain Python as well as in kernels
_FIELDS = [
    ("active", np.bool_),  # the geom touches, has lost touch only now, or has a deficit
    ("absent", np.float64),  # how long it has not touched [s]
    ("age", np.float64),  # how long it has touched [s]
    ("unbroken", np.float64),  # how long it has touched since its last opening [s]
    ("chatters", np.bool_),
    ("springy", np.bool_),  # it has chattered before
    ("side", np.float64),  # 1 where it pushes inwards, -1 outwards; forces are amounts along that
    ("level", np.float64),  # its force, averaged over chatter [N]
    ("deficit", np.float64),  # impulse that the target has not received yet [N s]
    ("prepaid", np.float64),  # impulse that the target has received before [N s]
    ("memory", np.float64),  # time over which means are taken, short where something changes [s]
    ("mean_force", np.float64),  # mean force [N]
    ("place", np.float64, 3),  # where it is [m]
    ("mean_place", np.float64, 3),  # [m]
    ("jitter", np.float64),  # mean distance of its contact points from its place [m]
    ("first", np.int64),  # its texels among the mean shares
    ("last", np.int64),
]
CONTACT_STATE = np.dtype((np.record, _FIELDS))


class TexelForces(NamedTuple):
    """Contact forces on the texels of a target in one step, geom by geom.

    Attributes
    ----------
    geoms : int64 [p]
        Geom ids, ascending.
    middles : float64 [p, 3]
        Force-weighted contact points [m].
    place_radii : float64 [p]
        A geom has left its place where its contact point has moved by more than this [m].
    begins : int64 [p + 1]
        The texels of geom i are those from begins[i] to begins[i + 1].
    texels : int64 [k]
        Flat texel indices.
    forces : float64 [k]
        [N].
    """

    geoms: Ints
    middles: Floats
    place_radii: Floats
    begins: Ints
    texels: Ints
    forces: Floats


NO_FORCES = TexelForces(
    np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0), np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0)
)


class RestFilter:
    """Filters the contact forces on one target.

    Parameters
    ----------
    geoms, texels : int
        How many there are.
    time_constant : float
        Of contacts [s].
    """

    def __init__(self, geoms: int, texels: int, time_constant: float = DEFAULT_TIME_CONSTANT) -> None:
        self._time_constant, self._unit = time_constant, 1.0
        self._states = np.zeros(geoms, CONTACT_STATE)
        # texels under the geoms, and the mean share of each in the force of its geom; those of a geom add up to 1
        self._texels, self._shares = np.zeros(0, np.int64), np.zeros(0)
        self._slots, self._is_over = np.full(texels, -1), True

    @property
    def active(self) -> Bools:
        """Geoms that touch, have lost touch only now, or have yet to give an impulse, [c]."""
        return np.asarray(self._states["active"])

    def forget_places(self) -> None:
        """Begin to average anew, as where other texels carry loads than before."""
        self._states["memory"] = 0.0

    def set_timestep(self, timestep: float) -> None:
        """Scale all times for physics steps of this length [s]."""
        unit = max(timestep / _TIME_STEP, self._time_constant / DEFAULT_TIME_CONSTANT)
        if unit != self._unit:
            for name in ("deficit", "prepaid"):
                self._states[name] *= self._unit / unit
            self._unit = unit

    def arrived(self, geoms: Ints, dt: float) -> list[int]:
        """Which rows of geoms that touch over a time [s] did not before."""
        states, dt = list(self._states[geoms]), dt / self._unit
        return [i for i, each in enumerate(states) if not each.active or _has_left(each, dt)]

    def prepay(self, geom: int, impulse: float) -> None:
        """What a geom will give next, so much of it [N s], positive inwards, the target has already."""
        state, side = self._states[geom], np.sign(impulse)
        if impulse:
            state.side, state.deficit = side, side * state.side * state.deficit
            state.prepaid += abs(impulse) / self._unit

    def __call__(self, present: TexelForces, dt: float) -> Load:
        """Load over a time [s] in which these forces act."""
        if self._is_over and not len(present.geoms):
            return Load.none()
        size = len(self._texels) + len(present.texels)
        under, mean, forces = np.empty(size, np.int64), np.empty(size), np.empty(size)
        before = self._states, self._texels, self._shares
        end, self._is_over = _filter(*before, present, dt / self._unit, self._slots, under, mean, forces)
        self._texels, self._shares = under[:end], mean[:end]
        return Load(self._texels, forces[:end])


@kernel
def _filter(
    states: np.ndarray, texels: Ints, shares: Floats, present: TexelForces, dt: float, slots: Ints,
    under: Ints, mean: Floats, given: Floats,
) -> tuple[int, bool]:  # fmt: skip
    """Fill in the texels under the geoms; how many there are, and whether all geoms have left.

    Parameters
    ----------
    states : CONTACT_STATE [ngeom]
        Updated.
    texels, shares
        Those of the step before.
    present : TexelForces
    dt : float
        Time step [s].
    slots : int64 [C n n]
        Scratch: -1 everywhere, before and after, so that a step costs no more on a larger grid.
    under, mean, given
        Texels under the geoms, their new mean shares, and the forces on them [N].
    """
    at, forces = present.texels, present.forces
    end, row, over = 0, 0, True
    for geom in range(len(states)):
        state, begin, force, first, last = states[geom], end, 0.0, 0, 0
        if row < len(present.geoms) and present.geoms[row] == geom:
            first, last = present.begins[row], present.begins[row + 1]
            row += 1
        for i in range(first, last):
            force += forces[i]
        if force != 0:
            side = 1.0 if force > 0 else -1.0
            if state.side != side:
                # what the target has not received yet stays as it is
                state.side, state.deficit, state.prepaid = side, state.prepaid - state.deficit, 0.0
            total = side * _touch(state, abs(force), present.middles[row - 1], present.place_radii[row - 1], dt)
            weight = dt / (dt + state.memory) if state.first < state.last else 1.0
            if weight < 1:
                end = _faded(texels, shares, state.first, state.last, 1 - weight, under, mean, given, slots, end)
            for i in range(first, last):
                slot = slots[at[i]]
                if slot < 0:
                    slot = slots[at[i]] = end
                    under[end], mean[end], given[end] = at[i], 0.0, 0.0
                    end += 1
                mean[slot] += weight * (forces[i] / force)
                given[slot] += forces[i] / force
            state.active = True
            steady = side * min(state.mean_force, side * total)
        elif state.active:
            total = steady = state.side * _miss(state, dt)
            for i in range(state.first, state.last):
                under[end], mean[end], given[end] = texels[i], shares[i], 0.0
                end += 1
        else:
            continue
        over = over and not state.active
        state.first, state.last = begin, end
        for i in range(begin, end):
            slots[under[i]] = -1
            given[i] = steady * mean[i] + (total - steady) * given[i]
    return end, over


@kernel(no_cpython_wrapper=True)
def _faded(
    texels: Ints, shares: Floats, first: int, last: int, left: float,
    under: Ints, mean: Floats, given: Floats, slots: Ints, end: int,
) -> int:  # fmt: skip
    """Enter the mean shares of a geom's texels from `end` on, so that what is left adds up; one after the last."""
    whole = 0.0
    for i in range(first, last):
        if shares[i] > _LEAST_SHARE:
            whole += shares[i]
    fading = left / whole
    for i in range(first, last):
        if shares[i] > _LEAST_SHARE:
            under[end], mean[end], given[end] = texels[i], fading * shares[i], 0.0
            slots[texels[i]] = end
            end += 1
    return end


@shared
def _has_left(state: Any, dt: float) -> bool:
    """Whether a geom is gone, and not open for a moment only."""
    return state.absent > max(_LEFT, 1.5 * dt)


@kernel(no_cpython_wrapper=True)
def _touch(state: Any, force: float, middle: Floats, place_radius: float, dt: float) -> float:
    """Follow a contact for a step; force that the target gets [N].

    Parameters
    ----------
    state : CONTACT_STATE
    force : float
        [N].
    middle : float64 [3]
        Force-weighted contact point [m].
    place_radius : float
        How far the place may be from its mean [m].
    dt : float
        [s].
    """
    if not state.active or _has_left(state, dt):
        state.age, state.unbroken, state.level, state.mean_force = 0.0, 0.0, force, force
        state.chatters, state.springy = False, False
        state.jitter = place_radius
        for k in range(3):
            state.place[k] = state.mean_place[k] = middle[k]
    elif state.absent > 0:
        if state.age > _ONSET and state.unbroken < max(_CHATTER_PERIOD, _CHATTER_STEPS * dt):
            state.springy = True
        state.chatters, state.unbroken = state.springy, 0.0
    state.absent = 0.0
    state.age += dt
    state.unbroken += dt
    state.chatters = state.chatters and state.unbroken < _CALM
    hit = force - state.mean_force if state.chatters and force > _HIT * state.mean_force else 0.0
    state.level += dt / (dt + _AVERAGED) * (force - hit - state.level)
    # the mean force follows; a hit ends the memory
    if state.age < _ONSET:
        unchanged = 0.0
    elif state.springy or state.unbroken < _CALM:
        unchanged = _HIT - force / max(state.mean_force, _TINY)
    else:
        unchanged = 2 - abs(force - state.mean_force) / max(_CHANGE * state.mean_force, _TINY)
    state.memory = min(state.memory + _GROWTH * dt, _LONGEST_MEMORY) * min(max(unchanged, 0.0), 1.0)
    now = state.level if state.chatters else force
    state.mean_force += dt / (dt + state.memory) * (now - state.mean_force)
    # the mean place follows, too; where the latest one leaves it, the memory becomes shorter
    jump2 = lag2 = 0.0
    for k in range(3):
        jump2 += (middle[k] - state.place[k]) ** 2
        state.place[k] += dt / (dt + _PLACE_MEMORY) * (middle[k] - state.place[k])
        state.mean_place[k] += dt / (dt + max(2 * _PLACE_MEMORY, state.memory)) * (middle[k] - state.mean_place[k])
        lag2 += (state.place[k] - state.mean_place[k]) ** 2
    state.jitter += dt / (dt + _JITTER_MEMORY) * (np.sqrt(jump2) - state.jitter)
    stays_within = _MOST_MOVE * place_radius
    if not state.springy:
        stays_within = min(max(_JITTERS * state.jitter, _LEAST_MOVE * place_radius), stays_within)
    if lag2 > stays_within**2:
        state.memory *= 1 - min(1.0, dt / _FOLLOWS_WITHIN) * (1 - stays_within / np.sqrt(lag2))
    return _given(state, force, hit, dt)


@kernel(no_cpython_wrapper=True)
def _miss(state: Any, dt: float) -> float:
    """Follow a contact for a step without touch; force that the target gets [N]."""
    state.absent += dt
    state.unbroken += dt
    state.level -= dt / (dt + _AVERAGED) * state.level
    # that of a springy contact does from its first opening on
    state.chatters = state.springy and not _has_left(state, dt)
    if _has_left(state, dt):  # nothing comes that would pay for it
        state.deficit, state.prepaid = state.deficit - state.prepaid, 0.0
    given = _given(state, 0.0, 0.0, dt)
    state.active = state.deficit != 0 or not _has_left(state, dt)
    return given


@kernel(no_cpython_wrapper=True)
def _given(state: Any, force: float, hit: float, dt: float) -> float:
    """Force that the target gets [N]; the difference goes to the deficit, of which a part is paid.

    What is prepaid it does not get again.
    """
    repaid = min(state.prepaid / dt, force)
    state.prepaid -= dt * repaid
    force -= repaid
    given = state.level + hit if state.chatters else force
    state.deficit += dt * (force - given)
    if state.deficit != 0:
        share = dt / (dt + _PAID_WITHIN)
        if _has_left(state, dt):
            # even parts
            share = min(1.0, dt / max(_AVERAGED - state.absent, dt))
        paid = share * state.deficit
        state.deficit -= paid
        given += paid / dt
    return given
