"""Bodies so fast that they would go through a target, or get stuck in it: found before they touch, and reported."""

from __future__ import annotations

import warnings

import mujoco
import numba
import numpy as np
from numpy.typing import NDArray

from ..errors import RippleWarning
from .target import geom_name

_ENDLESS = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))

_SAFE = 0.85
# Speeds are looked at this often [steps], and for as many steps ahead.
_EVERY = 5


class SpeedCheck:
    """Compares how deep bodies will get into the targets with how thick both are.

    A body that arrives at speed v gets in by about v dt before MuJoCo sees the contact, and then by v t_soft before the
    contact's spring has stopped it: t_soft = tau zeta exp(-zeta) for a `solref` of time constant tau and damping ratio
    zeta (a critically damped spring at zeta = 1). Past the sum of the two geoms' smallest half-extents it comes out
    on the other side or stays inside; the first that do were seen at 0.9 of it. Every pair is warned of once.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : sequence of int
        Geom ids.
    """

    def __init__(self, model: mujoco.MjModel, targets: list[int]) -> None:
        self._model = model
        kinds, bodies = model.geom_type, model.geom_bodyid
        thickness = model.geom_aabb[:, 3:].min(axis=1)
        pairs = [
            (target, other)
            for target in targets
            for other in range(model.ngeom)
            if kinds[other] not in _ENDLESS and bodies[other] != bodies[target] and _collide(model, target, other)
        ]
        self._target, self._other = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
        self._limit = _SAFE * (thickness[self._target] + thickness[self._other])
        self._reach = model.geom_rbound[self._target] + model.geom_rbound[self._other]
        solref = (model.geom_solref[self._target] + model.geom_solref[self._other]) / 2
        self._soft = _stopping_time(solref, model.opt.timestep)
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
            f"through it or get stuck: with a time step of {model.opt.timestep:.2g} s it gets in by "
            f"{speed * (model.opt.timestep + float(self._soft[i])):.2g} m, of which {limit:.2g} m are safe; {advice}"
        )


def _collide(model: mujoco.MjModel, first: int, second: int) -> bool:
    types, affinities = model.geom_contype, model.geom_conaffinity
    return bool(types[first] & affinities[second] or types[second] & affinities[first])


def _stopping_time(solref: NDArray[np.float64], timestep: float) -> NDArray[np.float64]:
    """Depth over speed [s] of contacts with these parameters, shape [k]."""
    # negative pairs are -stiffness and -damping for each kg: omega = sqrt(stiffness), ratio = damping / (2 omega)
    direct = solref[:, 0] <= 0
    omega = np.sqrt(np.where(direct, np.maximum(-solref[:, 0], 1e-12), 1.0))
    constant = np.maximum(solref[:, 0], 2 * timestep)
    ratio = np.where(direct, -solref[:, 1] / (2 * omega), solref[:, 1])
    period = np.where(direct, 1 / omega, constant * ratio)
    return period * np.exp(-np.clip(ratio, 0, 1))


@numba.njit(cache=True)
def _meeting(target, other, limit, reach, soft, timestep, place, velocity, mass_centre, body, root):
    """Indices of the pairs that come near each other too fast within the steps to the next look, and their speeds."""
    found, speeds = np.empty(len(target), np.int64), np.empty(len(target))
    count = 0
    for i in range(len(target)):
        offset = place[other[i]] - place[target[i]]
        relative = _at(other[i], place, velocity, mass_centre, body, root) - _at(
            target[i], place, velocity, mass_centre, body, root
        )
        speed = np.sqrt((relative**2).sum())
        near = np.sqrt((offset**2).sum()) < reach[i] + (1 + _EVERY) * speed * timestep
        if near and (offset * relative).sum() < 0 and speed * (timestep + soft[i]) > limit[i]:
            found[count], speeds[count] = i, speed
            count += 1
    return found[:count], speeds[:count]


@numba.njit(cache=True)
def _at(geom, place, velocity, mass_centre, body, root):
    """Velocity of a geom's centre in the world [m/s]."""
    b = body[geom]
    # MuJoCo gives a body's velocity at the centre of mass of the tree that it belongs to
    x, y, z = place[geom] - mass_centre[root[b]]
    wx, wy, wz, vx, vy, vz = velocity[b]
    return np.array([vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x])
