"""The rest filter: the surface under a geom at rest becomes still, and nothing else changes.

What flickers under a geom at rest is where it presses: MuJoCo splits its weight otherwise among the contact points of
every step. The sum of its contact forces is smooth, and passes as it is; the place is averaged over a memory that grows
while nothing changes, and is short where force or place do.

A contact that chatters is the exception: its force is averaged over some periods too. The deficit [N s] is what the
surface has yet to receive, so that nothing is lost.

The contact of one geom with a target over time: how long nothing has changed, and whether it chatters.

A geom on stiff, springy contacts chatters: contact opens for a step and closes again, at the natural frequency of the
contact's spring, and the force jumps between nothing and twice the weight.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints, kernel

from .footprints import MeanShares, TexelForces

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
_TINY = np.finfo(np.float64).tiny

CONTACT_STATE = np.dtype(
    [
        ("active", np.bool_),  # the geom touches, has lost touch only now, or has a deficit
        ("absent", np.float64),  # how long it has not touched [s]
        ("age", np.float64),  # how long it has touched [s]
        ("unbroken", np.float64),  # how long it has touched since its last opening [s]
        ("chatters", np.bool_),
        ("springy", np.bool_),  # it has chattered before
        ("side", np.float64),  # 1 where it pushes inwards, -1 outwards; forces are amounts along that
        ("level", np.float64),  # its force, averaged over chatter [N]
        ("deficit", np.float64),  # impulse that the target has not received yet [N s]
        ("memory", np.float64),  # time over which means are taken, short where something changes [s]
        ("mean", np.float64),  # mean force [N]
        ("place", np.float64, 3),  # where it is [m]
        ("mean_place", np.float64, 3),  # [m]
        ("jitter", np.float64),  # mean distance of its contact points from its place [m]
        ("first", np.int64),  # its texels among the `MeanShares`
        ("last", np.int64),
    ]
)


@kernel
def has_left(state: Any, dt: float) -> bool:
    """Whether a geom is gone, and not open for a moment only."""
    return state.absent > max(_LEFT, 1.5 * dt)


@kernel
def turn(state: Any, side: float) -> None:
    """Follow a geom that pushes inwards, 1, or outwards, -1: what the target has not received yet stays as it is."""
    if state.side != side:
        state.deficit = -state.deficit
        state.side = side


@kernel
def touch(state: Any, force: float, middle: Floats, place_radius: float, dt: float) -> float:
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
    if not state.active or has_left(state, dt):
        state.age, state.unbroken, state.level, state.mean = 0.0, 0.0, force, force
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
    hit = force - state.mean if state.chatters and force > _HIT * state.mean else 0.0
    state.level += dt / (dt + _AVERAGED) * (force - hit - state.level)
    _follow_force(state, force, dt)
    _follow_place(state, middle, place_radius, dt)
    return _given(state, force, hit, dt)


@kernel
def miss(state: Any, dt: float) -> float:
    """Follow a contact for a step without touch; force that the target gets [N]."""
    state.absent += dt
    state.unbroken += dt
    state.level -= dt / (dt + _AVERAGED) * state.level
    # that of a springy contact does from its first opening on
    state.chatters = state.springy and not has_left(state, dt)
    given = _given(state, 0.0, 0.0, dt)
    state.active = state.deficit != 0 or not has_left(state, dt)
    return given


@kernel
def _given(state: Any, force: float, hit: float, dt: float) -> float:
    """Force that the target gets [N]; the difference goes to the deficit, of which a part is paid."""
    given = state.level + hit if state.chatters else force
    state.deficit += dt * (force - given)
    if state.deficit != 0:
        share = dt / (dt + _PAID_WITHIN)
        if has_left(state, dt):
            # even parts
            share = min(1.0, dt / max(_AVERAGED - state.absent, dt))
        paid = share * state.deficit
        state.deficit -= paid
        given += paid / dt
    return given


@kernel
def _follow_force(state: Any, force: float, dt: float) -> None:
    """Let the mean force follow; a hit ends the memory."""
    if state.age < _ONSET:
        kept = 0.0
    elif state.springy or state.unbroken < _CALM:
        kept = _HIT - force / max(state.mean, _TINY)
    else:
        kept = 2 - abs(force - state.mean) / max(_CHANGE * state.mean, _TINY)
    state.memory = min(state.memory + _GROWTH * dt, _LONGEST_MEMORY) * min(max(kept, 0.0), 1.0)
    now = state.level if state.chatters else force
    state.mean += dt / (dt + state.memory) * (now - state.mean)


@kernel
def _follow_place(state: Any, middle: Floats, place_radius: float, dt: float) -> None:
    """Let the mean place follow; where the latest one leaves it, the memory becomes shorter."""
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
