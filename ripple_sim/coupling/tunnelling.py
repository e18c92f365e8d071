"""Tunnelling: geoms so fast that they would pass through a target or get stuck in it are reported before they touch."""

from __future__ import annotations

import warnings

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import RippleWarning

from .approach import APPROACH, too_fast
from .model import CoupledModel

_SDF = int(mujoco.mjtGeom.mjGEOM_SDF)
_CYLINDER = int(mujoco.mjtGeom.mjGEOM_CYLINDER)
# The flag that enables MuJoCo's speculative contacts, which it has from version 4 on; 0 before.
SPECULATIVE = int(getattr(mujoco.mjtEnableBit, "mjENBL_SPECULATIVE", 0))

_SAFE = 0.85
# Depth over a geom's smallest half-extent at which contacts with a signed distance begin to push from all sides: seen
# at 1.4, not yet at 1.2.
_SAFE_IN_SDF = 1.2
# Depth over a flex's thickness at which it begins to throw cylinders aside.
_SAFE_IN_FLEX = 0.7
# The check runs once in so many steps, and looks as many steps ahead.
_EVERY = 5


class TunnellingCheck:
    """Compares how deep geoms will sink into the targets with how thick both are.

    A geom that arrives at speed v sinks in by about v dt before MuJoCo sees the contact, and then by v t_stop before
    the contact's spring has stopped it: t_stop = tau zeta exp(-zeta) for a `solref` of time constant tau and damping
    ratio zeta (a critically damped spring at zeta = 1). Past the sum of the two geoms' smallest half-extents it comes
    out on the other side or stays inside; the first that did so were seen at 0.9 of that sum. A geom that is inside an
    SDF geom by more than its own half-extent is pushed from all sides: the normal forces then add up to many times the
    momentum exchanged. A warning is given once for each pair. MuJoCo's speculative contacts, where the version has them
    and they are enabled, stop geoms in time, but not at SDF geoms or flexes: then only those are checked.

    A flex collider holds geoms off by its thickness, which counts in place of the half-extent of its geom. Cylinders
    that sink in by 0.7 of the thickness begin to be thrown aside.

    Parameters
    ----------
    coupled : CoupledModel
    targets : sequence of int
        Geom ids.
    """

    def __init__(self, coupled: CoupledModel, targets: list[int]) -> None:
        self._model, self._names = coupled.model, coupled.names
        self._pairs = _watched_pairs(coupled, targets)
        roots = coupled.model.body_rootid[coupled.model.geom_bodyid]
        self._bodies = np.column_stack([coupled.model.geom_bodyid, roots])
        self._warned = np.zeros(len(self._pairs), dtype=bool)
        self._steps = 0

    def __call__(self, data: mujoco.MjData) -> None:
        """Warn of the pairs that are about to meet too fast. Call it after each physics step."""
        self._steps += 1
        if not len(self._warned) or (self._steps - 1) % _EVERY:
            return
        rows, speeds = too_fast(
            self._pairs,
            data.geom_xpos,
            data.cvel,
            data.subtree_com,
            self._bodies,
            self._model.opt.timestep,
            _EVERY,
        )
        for i, speed in zip(rows.tolist(), speeds.tolist(), strict=True):
            if not self._warned[i]:
                self._warned[i] = True
                warnings.warn(self._message(i, speed), RippleWarning, stacklevel=4)

    def _message(self, i: int, speed: float) -> str:
        model, names, timestep = self._model, self._names, self._model.opt.timestep
        target, other, limit, _, stopping_time = self._pairs[i].item()
        body = model.body(int(model.geom_bodyid[other])).name or names[other]
        needed = limit / speed - stopping_time
        # MuJoCo keeps a contact's time constant at two time steps or more
        advice = (
            f"use a time step of {needed:.2g} s or less"
            if needed > 0
            else f"use a time step of {limit / speed / (1 + 2 / np.e):.2g} s or less, and a solref of twice that"
        )
        return (
            f"body {body!r} meets geom {names[target]!r} at {speed:.3g} m/s and would pass through it, get stuck or "
            f"give a wrong impulse: with a time step of {timestep:.2g} s it sinks in by "
            f"{speed * (timestep + stopping_time):.2g} m, of which {limit:.2g} m are safe; {advice}"
        )


def _watched_pairs(coupled: CoupledModel, targets: list[int]) -> NDArray[np.void]:
    """Pairs of a geom that collides for a target and another geom, which may tunnel, `APPROACH` [p]."""
    model, extents, flex = coupled.model, coupled.collider_extents, coupled.has_flex
    sdf, cylinder = model.geom_type == _SDF, model.geom_type == _CYLINDER
    unchecked = sdf | flex if model.opt.enableflags & SPECULATIVE else np.ones(model.ngeom, dtype=bool)
    pairs = [
        (target, other)
        for target in dict.fromkeys(geom for each in targets for geom in coupled.collision_geoms(each))
        for other in np.flatnonzero(coupled.can_collide(target)).tolist()
        if np.isfinite(extents[other]) and (unchecked[target] or unchecked[other])
    ]
    target, other = np.array(pairs, dtype=np.int64).reshape(-1, 2).T.copy()
    limit = _SAFE * (extents[target] + extents[other])
    for geom, around in ((target, other), (other, target)):
        safe = np.where(sdf[around], _SAFE_IN_SDF * extents[geom], np.inf)
        safe = np.where(flex[around] & cylinder[geom], _SAFE_IN_FLEX * extents[around], safe)
        limit = np.minimum(limit, safe)
    reach = model.geom_rbound[target] + model.geom_rbound[other]
    solref = (coupled.solref[target] + coupled.solref[other]) / 2
    stopping_times = _stopping_times(solref, model.opt.timestep)
    return np.array(list(zip(target, other, limit, reach, stopping_times, strict=True)), APPROACH)


def _stopping_times(solref: NDArray[np.float64], timestep: float) -> NDArray[np.float64]:
    """Depth over speed [s], [k], of contacts with these parameters, [k, 2]."""
    # negative pairs are -stiffness and -damping for each kg: omega = sqrt(stiffness), ratio = damping / (2 omega)
    direct = solref[:, 0] <= 0
    omega = np.sqrt(np.where(direct, np.maximum(-solref[:, 0], 1e-12), 1.0))
    constant = np.maximum(solref[:, 0], 2 * timestep)
    ratio = np.where(direct, -solref[:, 1] / (2 * omega), solref[:, 1])
    period = np.where(direct, 1 / omega, constant * ratio)
    return period * np.exp(-np.clip(ratio, 0, 1))
