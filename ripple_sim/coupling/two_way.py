"""Two-way coupling: where the surface moves outwards under a body, it pushes the body, and is held back by it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Load, WaveSolver

from .contact_record import Touch
from .model import CoupledModel
from .reach import Reach


class _Patch(NamedTuple):
    """The patch of surface under a touch: mass [kg], outward velocity [m/s], and how a unit force spreads over it."""

    mass: float
    velocity: float
    shares: Load


class PushBack:
    """Exchanges momentum between moving surfaces and the bodies that touch them.

    MuJoCo sees a target's undeformed surface, which stops what comes in. So only the surface's own outward motion is
    left to pass on, to bodies that touch that surface or are within reach of the displaced one: a patch of mass m_s
    that moves outwards at u meets a body of effective mass m_b that moves along the normal at w >= 0, both relative to
    the target. As in a perfectly inelastic collision, which cannot create energy, they exchange
    J = (u - w) m_s m_b / (m_s + m_b) if u > w: +J on the body, -J on the surface and on the target's body.

    The bodies receive J at once, as a change of `data.qvel`: forces in `data` are the user's, and none is left there.

    Parameters
    ----------
    coupled : CoupledModel
    targets : iterable of int
        Geom ids.
    """

    def __init__(self, coupled: CoupledModel, targets: Iterable[int]) -> None:
        self._model, self._bodies = coupled.model, coupled.bodies
        self._reach = Reach(coupled, targets)

    def exchange(
        self, data: mujoco.MjData, touches: Sequence[Touch], waves: Mapping[int, WaveSolver], elapsed: float
    ) -> list[tuple[int, Load]]:
        """Push the bodies, and return the loads that push the targets, by geom id, over the elapsed time [s].

        Parameters
        ----------
        data : mujoco.MjData
        touches : sequence of Touch
            The pairs that touch.
        waves : mapping
            Waves of each target before the step, by geom id.
        elapsed : float
        """
        pairs = {(touch.target, touch.other) for touch in touches}
        touches = [*touches, *self._reach.reached(data, waves, pairs)]
        velocities = {touch.target: waves[touch.target].velocity.reshape(-1) for touch in touches}
        loads = []
        for touch in touches:
            mass, velocity = waves[touch.target].operator.mass.reshape(-1), velocities[touch.target]
            patch = _patch(touch, mass, velocity)
            impulse = 0.0 if patch is None else self._push(data, touch, patch)
            if patch is not None and impulse:
                texels, impulses = patch.shares.texels, impulse * patch.shares.forces
                velocity[texels] -= impulses / mass[texels]  # what the next touch meets
                loads.append((touch.target, Load(texels, impulses / elapsed)))
        return loads

    def _push(self, data: mujoco.MjData, touch: Touch, patch: _Patch) -> float:
        """Push the bodies with the impulse that they exchange with a patch, and return it [N s]."""
        if patch.velocity <= 0 or self._bodies[touch.other] < 0:
            return 0.0
        model, point = self._model, touch.point
        body, base = int(self._bodies[touch.other]), int(self._bodies[touch.target])
        along = touch.normal @ (_jacobian(model, data, body, point) - _jacobian(model, data, base, point))
        response = np.zeros((1, model.nv))
        mujoco.mj_solveM(model, data, response, along[None])
        inverse_mass = float(along @ response[0])
        approach = patch.velocity - max(0.0, float(along @ data.qvel))
        if inverse_mass <= 0 or approach <= 0:
            return 0.0
        impulse = approach / (1 / patch.mass + inverse_mass)
        data.qvel += impulse * response[0]
        return impulse


def _patch(touch: Touch, mass: NDArray[np.float64], velocity: NDArray[np.float32]) -> _Patch | None:
    """The patch under a touch, from mass [kg] and velocity [m/s] of all texels; None where nothing is movable."""
    load = touch.load.merged(mass.size)
    total = load.forces.sum()
    if total <= 0:
        return None
    shares = load.forces / total
    patch_mass = 1 / float((shares**2 / mass[load.texels]).sum())
    return _Patch(patch_mass, float(shares @ velocity[load.texels]), Load(load.texels, shares))


def _jacobian(model: mujoco.MjModel, data: mujoco.MjData, body: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocity of a body's point over qvel, [3, nv]."""
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, point, body)
    return jacobian
