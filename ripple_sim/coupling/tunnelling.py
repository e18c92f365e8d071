"""Warnings of geoms so fast that they would pass through a target or get stuck in it, before they touch."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Floats, Ints

from .model import SPECULATIVE, CoupledModel

_SAFE = 0.85


# Depth over a geom's smallest half-extent at which contacts with a signed distance begin to push
# from all sides: seen at 1.4, not yet at 1.2.
_SAFE_IN_SDF = 1.2


# Depth over a flex's thickness at which it begins to throw cylinders aside.
_SAFE_IN_FLEX = 0.7


# The check runs once in so many steps, and looks as many steps ahead.
_EVERY = 5


# How much less time a pair must have than that of the last warning to be told of.
_WORSE = 2.0


# A pair to watch.
PAIR = np.dtype(
    [
        ("target", np.int64),  # geom ids
        ("other", np.int64),
        ("limit", np.float64),  # depth up to which a contact is safe [m]
        ("range", np.float64),  # distance of the geoms' centres at which they may touch [m]
        ("stopping_time", np.float64),  # depth over speed after the first contact [s]
    ]
)


class TunnellingCheck:
    """Compares how deep geoms will sink into the targets with how thick both are.

    A geom that arrives at speed v sinks in by about v dt before MuJoCo sees the contact, and then
    by v t_stop before the contact's spring has stopped it: t_stop = tau zeta exp(-zeta) for a
    `solref` of time constant tau and damping ratio zeta (a critically damped spring at zeta = 1).
    Past the sum of the two geoms' smallest half-extents it comes out on the other side or stays
    inside; the first that did so were seen at 0.9 of that sum. A geom that is inside an SDF geom by
    more than its own half-extent is pushed from all sides: the normal forces then add up to many
    times the momentum exchanged. A warning names the pair that is worst, and comes again only where
    another is twice as bad: a humanoid that falls has dozens of pairs, and one advice serves them
    all. MuJoCo's speculative contacts, where the version has them and they are enabled, stop geoms
    in time, but not at SDF geoms or flexes: then only those are checked.

    A flex collider holds geoms off by its thickness, which counts in place of the half-extent of
    its geom. Cylinders that sink in by 0.7 of the thickness begin to be thrown aside.

    Parameters
    ----------
    coupled : CoupledModel
    targets : sequence of int
        Geom ids.
    """

    def __init__(self, coupled: CoupledModel, targets: list[int]) -> None:
        self._model = coupled.model
        self._names = coupled.names
        self._pairs = _watched_pairs(coupled, targets)
        # within how long the pair of the last warning would have had to stop [s]
        self._told = np.inf
        self._steps = 0

    def __call__(self, data: mujoco.MjData) -> None:
        """Warn of a pair that is about to meet too fast. Call it after each physics step."""
        self._steps += 1
        if not len(self._pairs) or (self._steps - 1) % _EVERY:
            return
        rows, speeds = too_fast(self._pairs, self._model, data, _EVERY)
        times = self._pairs["limit"][rows] / speeds
        if not times.min(initial=np.inf) < self._told / _WORSE:
            return
        worst = int(times.argmin())
        self._told = float(times[worst])
        speed = float(speeds[worst])
        model = self._model
        names = self._names
        timestep = self._model.opt.timestep
        target, other, limit, _, stopping_time = self._pairs[rows[worst]].item()
        body = model.body(int(model.geom_bodyid[other])).name or names[other]
        needed = limit / speed - stopping_time
        # MuJoCo keeps a contact's time constant at two time steps or more
        shortest = limit / speed / (1 + 2 / np.e)
        if needed > 0:
            advice = f"use a time step of {needed:.2g} s or less"
        elif shortest < timestep:
            advice = f"use a time step of {shortest:.2g} s or less, and a solref of twice that"
        else:
            advice = f'use a solref of "{np.e * (limit / speed - timestep):.2g} 1" or less for both'
        warn_caller(
            f"body {body!r} meets geom {names[target]!r} at {speed:.3g} m/s and would pass through "
            f"it, get stuck or "
            f"give a wrong impulse: with a time step of {timestep:.2g} s it sinks in by "
            f"{speed * (timestep + stopping_time):.2g} m, of which {limit:.2g} m are safe; {advice}"
        )


def too_fast(
    pairs: np.ndarray, model: mujoco.MjModel, data: mujoco.MjData, steps: int
) -> tuple[Ints, Floats]:
    """Rows of the pairs, `PAIR`, that may touch within some steps and sink in beyond their limits, and speeds [m/s]."""
    body = model.geom_bodyid
    target = pairs["target"]
    other = pairs["other"]
    timestep = model.opt.timestep
    # MuJoCo gives a body's velocity at the centre of mass of the tree that it belongs to
    from_root = data.geom_xpos - data.subtree_com[model.body_rootid[body]]
    velocities = data.cvel[body, 3:] + np.cross(data.cvel[body, :3], from_root)
    away = data.geom_xpos[other] - data.geom_xpos[target]
    relative = velocities[other] - velocities[target]
    distances = np.linalg.norm(away, axis=1)
    speeds = np.linalg.norm(relative, axis=1)
    near = distances < pairs["range"] + (1 + steps) * speeds * timestep
    approaching = np.einsum("ij,ij->i", away, relative) < 0
    rows = np.flatnonzero(
        near & approaching & (speeds * (timestep + pairs["stopping_time"]) > pairs["limit"])
    )
    return rows, speeds[rows]


def _watched_pairs(coupled: CoupledModel, targets: list[int]) -> NDArray[np.void]:
    """Pairs of a geom that collides for a target and another geom, which may tunnel, `PAIR` [p]."""
    model = coupled.model
    extents = coupled.collider_extents
    flex = coupled.has_flex[: coupled.model.ngeom]
    sdf, cylinder = (
        model.geom_type == kind
        for kind in (mujoco.mjtGeom.mjGEOM_SDF, mujoco.mjtGeom.mjGEOM_CYLINDER)
    )
    unchecked = (
        sdf | flex if model.opt.enableflags & SPECULATIVE else np.ones(model.ngeom, dtype=bool)
    )
    pairs = [
        (target, other)
        for target in dict.fromkeys(
            geom for each in targets for geom in coupled.collision_geoms(each)
        )
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
    # negative pairs are -stiffness and -damping for each kg: omega = sqrt(stiffness), ratio =
    # damping / (2 omega)
    direct = solref[:, 0] <= 0
    omega = np.sqrt(np.where(direct, np.maximum(-solref[:, 0], 1e-12), 1.0))
    constant = np.maximum(solref[:, 0], 2 * model.opt.timestep)
    ratio = np.where(direct, -solref[:, 1] / (2 * omega), solref[:, 1])
    stopping_times = np.where(direct, 1 / omega, constant * ratio) * np.exp(-np.clip(ratio, 0, 1))
    return np.array(list(zip(target, other, limit, reach, stopping_times, strict=True)), PAIR)
