"""The rest filter: the surface under a geom at rest becomes still, and nothing else changes.

Under a geom at rest, the place where it presses flickers: MuJoCo divides the geom's weight among
the contact points anew in every step. The sum of the contact forces is smooth, and passes as it is.
The place is averaged over a memory, which grows while nothing changes, and is short where force or
place change. A contact that chatters is the exception: its force is averaged too. `contact_state`
follows each contact; this module spreads the contact's force over its texels.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ripple_sim.solver import Load
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel

from .contact_state import (
    CONTACT_STATE,
    DEFAULT_TIME_CONSTANT,
    TIME_STEP,
    ContactState,
    is_gone,
    miss,
    touch,
    turn,
)

# Shares below this are dropped from the mean shares of a geom.
_MIN_SHARE = 1e-6


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


# The forces of a step in which nothing touches the target.
NO_FORCES = TexelForces(
    geoms=np.zeros(0, np.int64),
    middles=np.zeros((0, 3)),
    place_radii=np.zeros(0),
    begins=np.zeros(1, np.int64),
    texels=np.zeros(0, np.int64),
    forces=np.zeros(0),
)


class _Shares(NamedTuple):
    """The texels under all geoms, geom by geom, with the share of each in the force of its geom.

    Attributes
    ----------
    texels : int64 [k]
        Flat texel indices.
    mean : float64 [k]
        Mean shares; those of a geom add up to 1.
    latest : float64 [k]
        Shares in this step, 0 for texels that the geom has left.
    forces : float64 [k]
        Filtered forces on the texels [N].
    slots : int64 [C n n]
        Where a texel of the present geom stands in the arrays above, or -1. It is -1 everywhere
        before and after a step, so that a step costs no more on a larger grid.
    """

    texels: Ints
    mean: Floats
    latest: Floats
    forces: Floats
    slots: Ints


class RestFilter:
    """Filters the contact forces on one target.

    Parameters
    ----------
    geoms, texels : int
        Number of geoms, and of texels of the target.
    time_constant : float
        Of contacts with the target [s].
    """

    def __init__(
        self, geoms: int, texels: int, time_constant: float = DEFAULT_TIME_CONSTANT
    ) -> None:
        self._time_constant = time_constant
        self._time_scale = 1.0  # real time over that of `contact_state`
        self._states = np.zeros(geoms, CONTACT_STATE)
        self._texels = np.zeros(0, np.int64)
        self._mean_shares = np.zeros(0)
        self._slots = np.full(texels, -1)
        self._all_gone = True

    @property
    def active(self) -> Bools:
        """Geoms that touch, have just lost touch, or have yet to give an impulse, [c]."""
        return np.asarray(self._states["active"])

    def forget_places(self) -> None:
        """Restart the average, for instance because other texels carry loads than before."""
        self._states["memory"] = 0.0

    def arrived(self, geoms: Ints) -> list[int]:
        """Which rows of geoms that touch did not touch before."""
        states = list(self._states[geoms])
        return [row for row, state in enumerate(states) if not state.active or is_gone(state)]

    def prepay(self, geom: int, impulse: float, dt: float) -> None:
        """Note an impulse [N s], positive inwards, that came before the contact of a geom.

        `dt` is the time step in which the geom arrives [s].
        """
        if not impulse:
            return
        self._scale_times(dt)
        state = self._states[geom]
        side = np.sign(impulse)
        state.deficit = side * state.side * state.deficit
        state.side = side
        state.prepaid += abs(impulse) / self._time_scale

    def __call__(self, present: TexelForces, dt: float) -> Load:
        """Load of these forces over a time [s]."""
        if self._all_gone and not len(present.geoms):
            return Load.none()
        self._scale_times(dt)
        size = len(self._texels) + len(present.texels)
        shares = _Shares(
            texels=np.empty(size, np.int64),
            mean=np.empty(size),
            latest=np.empty(size),
            forces=np.empty(size),
            slots=self._slots,
        )
        count, self._all_gone = _filter(
            self._states, self._texels, self._mean_shares, present, dt / self._time_scale, shares
        )
        self._texels = shares.texels[:count]
        self._mean_shares = shares.mean[:count]
        return Load(self._texels, shares.forces[:count])

    def _scale_times(self, dt: float) -> None:
        """Scale all times for a time step [s] and for the time constant of the contacts."""
        scale = max(dt / TIME_STEP, self._time_constant / DEFAULT_TIME_CONSTANT)
        if scale != self._time_scale:
            for name in ("deficit", "prepaid"):
                self._states[name] *= self._time_scale / scale
            self._time_scale = scale


@kernel
def _filter(
    states: np.ndarray,
    texels: Ints,
    mean_shares: Floats,
    present: TexelForces,
    dt: float,
    out: _Shares,
) -> tuple[int, bool]:
    """Fill in the texels under all geoms; return their number, and whether all geoms are gone.

    Parameters
    ----------
    states : CONTACT_STATE [c]
        Updated.
    texels : int64 [m]
        Texels under all geoms in the step before.
    mean_shares : float64 [m]
        Their mean shares.
    present : TexelForces
        The contact forces of this step.
    dt : float
        Time step [s].
    out : _Shares
        Filled in.
    """
    end = 0
    row = 0
    all_gone = True
    for geom in range(len(states)):
        state = states[geom]
        begin = end
        # the rows of the geom's texels in `present`
        first = 0
        last = 0
        if row < len(present.geoms) and present.geoms[row] == geom:
            first = present.begins[row]
            last = present.begins[row + 1]
            row += 1
        force = 0.0
        for i in range(first, last):
            force += present.forces[i]
        if force != 0:
            side = 1.0 if force > 0 else -1.0
            turn(state, side)
            point = present.middles[row - 1]
            force_amount = touch(state, abs(force), point, present.place_radii[row - 1], dt)
            # weight of this step in the mean shares
            weight = dt / (dt + state.memory) if state.first < state.last else 1.0
            if weight < 1:
                end = _fade(state, texels, mean_shares, 1 - weight, out, end)
            end = _add_shares(present, first, last, force, weight, out, end)
            state.active = True
            filtered_force = side * force_amount
            steady_force = side * min(state.mean_force, force_amount)
        elif state.active:
            filtered_force = state.side * miss(state, dt)
            steady_force = filtered_force
            end = _keep(state, texels, mean_shares, out, end)
        else:
            continue
        all_gone = all_gone and not state.active
        state.first = begin
        state.last = end
        # the steady part of the force acts at the mean place, the rest where the geom touches now
        other_force = filtered_force - steady_force
        for i in range(begin, end):
            out.slots[out.texels[i]] = -1
            out.forces[i] = steady_force * out.mean[i] + other_force * out.latest[i]
    return end, all_gone


@kernel(no_cpython_wrapper=True)
def _fade(
    state: ContactState,
    texels: Ints,
    mean_shares: Floats,
    sum_of_shares: float,
    out: _Shares,
    end: int,
) -> int:
    """Enter a geom's earlier mean shares from `end` on, scaled to a sum; return the new end."""
    sum_before = 0.0
    for i in range(state.first, state.last):
        if mean_shares[i] > _MIN_SHARE:
            sum_before += mean_shares[i]
    scale = sum_of_shares / sum_before
    for i in range(state.first, state.last):
        if mean_shares[i] > _MIN_SHARE:
            out.texels[end] = texels[i]
            out.mean[end] = scale * mean_shares[i]
            out.latest[end] = 0.0
            out.slots[texels[i]] = end
            end += 1
    return end


@kernel(no_cpython_wrapper=True)
def _add_shares(
    present: TexelForces, first: int, last: int, force: float, weight: float, out: _Shares, end: int
) -> int:
    """Add the shares of this step, with a weight in the mean; return the new end of the slots."""
    for i in range(first, last):
        texel = present.texels[i]
        slot = out.slots[texel]
        if slot < 0:
            slot = end
            out.slots[texel] = slot
            out.texels[slot] = texel
            out.mean[slot] = 0.0
            out.latest[slot] = 0.0
            end += 1
        share = present.forces[i] / force
        out.mean[slot] += weight * share
        out.latest[slot] += share
    return end


@kernel(no_cpython_wrapper=True)
def _keep(state: ContactState, texels: Ints, mean_shares: Floats, out: _Shares, end: int) -> int:
    """Enter the earlier mean shares of a geom that does not touch; return the new end."""
    for i in range(state.first, state.last):
        out.texels[end] = texels[i]
        out.mean[end] = mean_shares[i]
        out.latest[end] = 0.0
        end += 1
    return end
