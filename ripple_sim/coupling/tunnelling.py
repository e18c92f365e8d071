"""Warnings of geoms so fast that they would pass through a target or get stuck in it."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Floats, Ints

from .ids import GeomId
from .model import SPECULATIVE, CoupledModel

# Safe depth over the sum of the two geoms' smallest half-extents: geoms came through at 0.9.
_SAFE_DEPTH = 0.85

# Safe depth over a geom's smallest half-extent in a signed distance field: contacts begin to push
# from all sides at 1.4, and do not yet at 1.2.
_SAFE_DEPTH_IN_SDF = 1.2

# Safe depth of cylinders over a flex's thickness: beyond it the flex begins to throw them aside.
_SAFE_DEPTH_IN_FLEX = 0.7

# The check runs once in so many steps, and looks as many steps ahead.
_CHECK_EVERY = 5

# A second warning is given for a pair that has this factor less time to stop than the pair of the
# last warning.
_WORSE = 2.0

# Keeps a division by the rate of a contact's spring finite: the least squared rate [1/s^2].
_MIN_SQUARED_RATE = 1e-12

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
    If it sinks in by more than the sum of the two geoms' smallest half-extents, it comes out on the
    other side or stays inside; the first geoms did so at 0.9 of the sum. A geom that is inside an
    SDF geom by more than its own half-extent is pushed from all sides: the normal forces then add
    up to many times the momentum exchanged. A warning names the worst pair. A second warning is
    given only if another pair is twice as bad: a humanoid that falls has dozens of pairs, and one
    advice serves them all. MuJoCo's speculative contacts, if the version has them and they are
    enabled, stop geoms in time, but not at SDF geoms or flexes: then only those are checked.

    A flex collider holds geoms off by its thickness, which counts in place of the half-extent of
    its geom. Cylinders that sink in by 0.7 of the thickness begin to be thrown aside.

    Parameters
    ----------
    coupled : CoupledModel
    targets : sequence of GeomId
    """

    def __init__(self, coupled: CoupledModel, targets: Sequence[GeomId]) -> None:
        self._model = coupled.model
        self._names = coupled.names
        self._pairs = _watched_pairs(coupled, targets)
        # time that the pair of the last warning had to stop [s]
        self._warned_time = np.inf
        self._steps = 0

    def __call__(self, data: mujoco.MjData) -> None:
        """Warn of a pair that is about to meet too fast. Call it after each physics step."""
        self._steps += 1
        if not len(self._pairs) or (self._steps - 1) % _CHECK_EVERY:
            return
        rows, speeds = too_fast(self._pairs, self._model, data, _CHECK_EVERY)
        times = self._pairs["limit"][rows] / speeds
        if not times.min(initial=np.inf) < self._warned_time / _WORSE:
            return
        worst = int(times.argmin())
        self._warned_time = float(times[worst])
        self._warn(self._pairs[rows[worst]], float(speeds[worst]))

    def _warn(self, pair: np.void, speed: float) -> None:
        """Warn of a pair, `PAIR`, that meets at a speed [m/s]."""
        target, other, limit, _, stopping_time = pair.item()
        timestep = self._model.opt.timestep
        names = self._names
        body = self._model.body(int(self._model.geom_bodyid[other])).name or names[other]
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
            f"it, get stuck or give a wrong impulse: with a time step of {timestep:.2g} s it sinks "
            f"in by {speed * (timestep + stopping_time):.2g} m, of which {limit:.2g} m are safe; "
            f"{advice}"
        )


def too_fast(
    pairs: np.ndarray, model: mujoco.MjModel, data: mujoco.MjData, steps: int
) -> tuple[Ints, Floats]:
    """Rows of the pairs that may soon sink in beyond their limits, and their speeds [m/s].

    Parameters
    ----------
    pairs : PAIR [p]
    model : mujoco.MjModel
    data : mujoco.MjData
    steps : int
        Within which the pairs may touch.
    """
    body = model.geom_bodyid
    target = pairs["target"]
    other = pairs["other"]
    timestep = model.opt.timestep
    # MuJoCo gives a body's velocity at the centre of mass of the tree that it belongs to
    from_root = data.geom_xpos - data.subtree_com[model.body_rootid[body]]
    velocities = data.cvel[body, 3:] + np.cross(data.cvel[body, :3], from_root)
    offsets = data.geom_xpos[other] - data.geom_xpos[target]
    relative_velocities = velocities[other] - velocities[target]
    distances = np.linalg.norm(offsets, axis=1)
    speeds = np.linalg.norm(relative_velocities, axis=1)
    may_touch = distances < pairs["range"] + (1 + steps) * speeds * timestep
    approaching = np.einsum("ij,ij->i", offsets, relative_velocities) < 0
    too_deep = speeds * (timestep + pairs["stopping_time"]) > pairs["limit"]
    rows = np.flatnonzero(may_touch & approaching & too_deep)
    return rows, speeds[rows]


def _watched_pairs(coupled: CoupledModel, targets: Sequence[GeomId]) -> NDArray[np.void]:
    """Pairs of a geom that collides for a target and another geom, which may tunnel, `PAIR` [p]."""
    model = coupled.model
    target, other = _pairs_at_risk(coupled, targets)
    pairs = np.zeros(len(target), PAIR)
    pairs["target"] = target
    pairs["other"] = other
    pairs["limit"] = _safe_depths(coupled, target, other)
    pairs["range"] = model.geom_rbound[target] + model.geom_rbound[other]
    pairs["stopping_time"] = _stopping_times(coupled, target, other)
    return pairs


def _pairs_at_risk(coupled: CoupledModel, targets: Sequence[GeomId]) -> tuple[Ints, Ints]:
    """Geom ids of pairs, [p] each, that MuJoCo's speculative contacts do not stop in time."""
    model = coupled.model
    at_risk = np.ones(model.ngeom, dtype=bool)
    if model.opt.enableflags & SPECULATIVE:
        at_risk = _is_sdf(model) | coupled.has_flex[: model.ngeom]
    is_thin = np.isfinite(coupled.collider_extents)
    # the geoms that collide for the targets, each once
    colliders: dict[GeomId, None] = {}
    for target in targets:
        colliders.update(dict.fromkeys(coupled.collision_geoms(target)))
    pairs = []
    for collider in colliders:
        for other in np.flatnonzero(coupled.can_collide(collider)).tolist():
            if is_thin[other] and (at_risk[collider] or at_risk[other]):
                pairs.append((collider, other))
    ids = np.array(pairs, dtype=np.int64).reshape(-1, 2).T.copy()
    return ids[0], ids[1]


def _is_sdf(model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Whether each geom is a signed distance field, [ngeom]."""
    return np.asarray(model.geom_type == mujoco.mjtGeom.mjGEOM_SDF)


def _safe_depths(coupled: CoupledModel, target: Ints, other: Ints) -> Floats:
    """Depth up to which a contact of each pair of geoms is safe [m], [p]."""
    model = coupled.model
    extents = coupled.collider_extents
    is_sdf = _is_sdf(model)
    has_flex = coupled.has_flex[: model.ngeom]
    is_cylinder = model.geom_type == mujoco.mjtGeom.mjGEOM_CYLINDER
    limits = _SAFE_DEPTH * (extents[target] + extents[other])
    for geom, partner in ((target, other), (other, target)):
        in_sdf = np.where(is_sdf[partner], _SAFE_DEPTH_IN_SDF * extents[geom], np.inf)
        is_thrown_aside = has_flex[partner] & is_cylinder[geom]
        in_flex = _SAFE_DEPTH_IN_FLEX * extents[partner]
        limits = np.minimum(limits, np.where(is_thrown_aside, in_flex, in_sdf))
    return limits


def _stopping_times(coupled: CoupledModel, target: Ints, other: Ints) -> Floats:
    """Depth over speed after the first contact of each pair of geoms [s], [p]."""
    solref = (coupled.solref[target] + coupled.solref[other]) / 2
    # negative numbers are -stiffness and -damping for each kg: omega = sqrt(stiffness), ratio =
    # damping / (2 omega)
    is_direct = solref[:, 0] <= 0
    omega = np.sqrt(np.where(is_direct, np.maximum(-solref[:, 0], _MIN_SQUARED_RATE), 1.0))
    time_constant = np.maximum(solref[:, 0], 2 * coupled.model.opt.timestep)
    ratio = np.where(is_direct, -solref[:, 1] / (2 * omega), solref[:, 1])
    times = np.where(is_direct, 1 / omega, time_constant * ratio)
    return times * np.exp(-np.clip(ratio, 0, 1))
