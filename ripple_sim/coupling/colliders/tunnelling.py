"""Bodies so fast that they would go through a target, or get stuck in it: found before they touch, and reported."""

from __future__ import annotations

import warnings

import mujoco
import numba
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.contacts.geom_contacts import smallest_extents
from ripple_sim.coupling.model.target import contact_masks, geom_name, shell_thickness, shells
from ripple_sim.errors import RippleWarning

_SDF = int(mujoco.mjtGeom.mjGEOM_SDF)
_CYLINDER = int(mujoco.mjtGeom.mjGEOM_CYLINDER)
# The flag of MuJoCo's speculative contacts, which it has from version 4 on; before, 0.
SPECULATIVE = int(getattr(mujoco.mjtEnableBit, "mjENBL_SPECULATIVE", 0))

_SAFE = 0.85
# Depth over a body's smallest half-extent at which contacts with a signed distance begin to push from all sides: seen
# at 1.4, not yet at 1.2.
_SAFE_IN_SDF = 1.2
# Depth over a shell's thickness at which it begins to throw cylinders aside.
_SAFE_IN_SHELL = 0.7
# Speeds are looked at this often [steps], and for as many steps ahead.
_EVERY = 5


class SpeedCheck:
    """Compares how deep bodies will get into the targets with how thick both are.

    A body that arrives at speed v gets in by about v dt before MuJoCo sees the contact, and then by v t_soft before the
    contact's spring has stopped it: t_soft = tau zeta exp(-zeta) for a `solref` of time constant tau and damping ratio
    zeta (a critically damped spring at zeta = 1). Past the sum of the two geoms' smallest half-extents it comes out
    on the other side or stays inside; the first that do were seen at 0.9 of it. In an SDF geom a body that is in by
    more than its own half-extent is pushed from all sides: the normal forces then add up to many times the momentum
    that is exchanged. Every pair is warned of once. MuJoCo's speculative contacts, where the version has them and they
    are enabled, stop bodies in time, but not at SDF geoms or flexes: then only those are checked.

    A flex that stands for a geom holds bodies off by its thickness, which counts in place of the geom's half-extent.
    Cylinders that get in by 0.7 of it begin to be thrown aside.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : sequence of int
        Geom ids.
    """

    def __init__(self, model: mujoco.MjModel, targets: list[int]) -> None:
        self._model = model
        extents, solref = smallest_extents(model), model.geom_solref.copy()
        sdf, cylinder = model.geom_type == _SDF, model.geom_type == _CYLINDER
        shell = np.zeros(model.ngeom, dtype=bool)
        for geom, flex in shells(model).items():
            shell[geom], extents[geom], solref[geom] = True, shell_thickness(model, flex), model.flex_solref[flex]
        unchecked = sdf | shell if model.opt.enableflags & SPECULATIVE else np.ones(model.ngeom, dtype=bool)
        pairs = [
            (target, other)
            for target in targets
            for other in np.flatnonzero(can_collide(model, target)).tolist()
            if np.isfinite(extents[other]) and (unchecked[target] or unchecked[other])
        ]
        self._target, self._other = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
        self._limit = _SAFE * (extents[self._target] + extents[self._other])
        for body, around in ((self._target, self._other), (self._other, self._target)):
            safe = np.where(sdf[around], _SAFE_IN_SDF * extents[body], np.inf)
            safe = np.where(shell[around] & cylinder[body], _SAFE_IN_SHELL * extents[around], safe)
            self._limit = np.minimum(self._limit, safe)
        self._reach = model.geom_rbound[self._target] + model.geom_rbound[self._other]
        self._soft = _stopping_time((solref[self._target] + solref[self._other]) / 2, model.opt.timestep)
        self._warned = np.zeros(len(pairs), dtype=bool)
        self._steps = 0

    def __call__(self, data: mujoco.MjData) -> None:
        """Warn of the pairs that are about to meet too fast. Call it after each physics step."""
        self._steps += 1
        if not len(self._limit) or (self._steps - 1) % _EVERY:
            return
        meeting, speed = _meeting(
            self._target,
            self._other,
            self._limit,
            self._reach,
            self._soft,
            self._model.opt.timestep,
            data.geom_xpos,
            data.cvel,
            data.subtree_com,
            self._model.geom_bodyid,
            self._model.body_rootid,
        )
        for i, v in zip(meeting.tolist(), speed.tolist(), strict=True):
            if not self._warned[i]:
                self._warned[i] = True
                warnings.warn(self._message(i, v), RippleWarning, stacklevel=4)

    def _message(self, i: int, speed: float) -> str:
        model, limit = self._model, float(self._limit[i])
        body = model.body(int(model.geom_bodyid[self._other[i]])).name or geom_name(model, int(self._other[i]))
        needed = limit / speed - float(self._soft[i])
        # MuJoCo keeps a contact's time constant at two time steps or more
        advice = (
            f"use a time step of {needed:.2g} s or less"
            if needed > 0
            else f"use a time step of {limit / speed / (1 + 2 / np.e):.2g} s or less, and a solref of twice that"
        )
        return (
            f"body {body!r} meets geom {geom_name(model, int(self._target[i]))!r} at {speed:.3g} m/s and would go "
            f"through it, get stuck or give a wrong impulse: with a time step of {model.opt.timestep:.2g} s it gets in "
            f"by {speed * (model.opt.timestep + float(self._soft[i])):.2g} m, of which {limit:.2g} m are safe; {advice}"
        )


def can_collide(model: mujoco.MjModel, geom: int) -> NDArray[np.bool_]:
    """Which geoms, [ngeom], MuJoCo lets collide with one by their masks or their flexes'; none of the same body."""
    types, affinities = contact_masks(model)
    return ((types[geom] & affinities | types & affinities[geom]) != 0) & (model.geom_bodyid != model.geom_bodyid[geom])


def _stopping_time(solref: NDArray[np.float64], timestep: float) -> NDArray[np.float64]:
    """Depth over speed [s] of contacts with these parameters, shape [k]."""
    # negative pairs are -stiffness and -damping for each kg: omega = sqrt(stiffness), ratio = damping / (2 omega)
    direct = solref[:, 0] <= 0
    omega = np.sqrt(np.where(direct, np.maximum(-solref[:, 0], 1e-12), 1.0))
    constant = np.maximum(solref[:, 0], 2 * timestep)
    ratio = np.where(direct, -solref[:, 1] / (2 * omega), solref[:, 1])
    period = np.where(direct, 1 / omega, constant * ratio)
    return period * np.exp(-np.clip(ratio, 0, 1))


@numba.njit(cache=True, nogil=True)
def _meeting(target, other, limit, reach, soft, timestep, place, velocity, mass_centre, body, root):
    """Indices of the pairs that come near each other too fast within the steps to the next look, and their speeds."""
    found, speeds = np.empty(len(target), np.int64), np.empty(len(target))
    count = 0
    moving = _velocities(place, velocity, mass_centre, body, root)
    for i in range(len(target)):
        away2, speed2, approach = 0.0, 0.0, 0.0
        for k in range(3):
            x, v = place[other[i], k] - place[target[i], k], moving[other[i], k] - moving[target[i], k]
            away2, speed2, approach = away2 + x * x, speed2 + v * v, approach - x * v
        speed = np.sqrt(speed2)
        near = np.sqrt(away2) < reach[i] + (1 + _EVERY) * speed * timestep
        if near and approach > 0 and speed * (timestep + soft[i]) > limit[i]:
            found[count], speeds[count] = i, speed
            count += 1
    return found[:count], speeds[:count]


@numba.njit(cache=True, nogil=True)
def _velocities(place, velocity, mass_centre, body, root):
    """Velocities of all geoms' centres in the world [m/s]."""
    found = np.empty((len(body), 3))
    for geom in range(len(body)):
        b = body[geom]
        for k in range(3):
            # MuJoCo gives a body's velocity at the centre of mass of the tree that it belongs to
            y, z = (k + 1) % 3, (k + 2) % 3
            turning = velocity[b, y] * (place[geom, z] - mass_centre[root[b], z])
            turning -= velocity[b, z] * (place[geom, y] - mass_centre[root[b], y])
            found[geom, k] = velocity[b, 3 + k] + turning
    return found
