"""Two-way coupling: where the surface moves outwards under a body, it pushes the body, and is held back by it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.load.contact_record import Touch
from ripple_sim.coupling.model.coupled_model import CoupledModel
from ripple_sim.solver import Load, WaveSolver

from .reach import Reach


class _Patch(NamedTuple):
    """The patch of surface under a touch: mass [kg], outward velocity [m/s], and how a unit force spreads over it."""

    mass: float
    velocity: float
    shares: Load


class PushBack:
    """Forces between moving surfaces and the bodies that touch them, held over the next physics step.

    MuJoCo sees a target's undeformed surface, which stops what comes in. So only the surface's own outward motion is
    left to pass on, to bodies that touch that surface or are within reach of the displaced one: a patch of mass m_s
    that moves outwards at u meets a body of effective mass m_b that moves along the normal at w >= 0, both relative to
    the target. As in a perfectly inelastic collision, which cannot create energy, they exchange
    J = (u - w) m_s m_b / (m_s + m_b) if u > w: +J on the body, -J on the surface and on the target's body.

    Parameters
    ----------
    coupled : CoupledModel
    targets : iterable of int
        Geom ids.
    """

    def __init__(self, coupled: CoupledModel, targets: Iterable[int]) -> None:
        self._model = coupled.model
        self._reach = Reach(coupled, targets)
        self._applied = np.zeros((coupled.model.nbody, 6))
        self._loads: list[tuple[int, Load]] = []

    def withdraw(self, data: mujoco.MjData) -> list[tuple[int, Load]]:
        """Take back the forces on the bodies, and give those on the targets over the latest step, by geom id."""
        data.xfrc_applied -= self._applied
        return self.forget()

    def forget(self) -> list[tuple[int, Load]]:
        """As `withdraw`, where MuJoCo has cleared its forces already."""
        self._applied[:] = 0
        loads, self._loads = self._loads, []
        return loads

    def apply(self, data: mujoco.MjData, touches: Sequence[Touch], waves: Mapping[int, WaveSolver]) -> None:
        """Set the forces for the next step, from the pairs that touch and the waves of each target, by geom id."""
        pairs = {(touch.target, touch.other) for touch in touches}
        touches = [*touches, *self._reach.reached(data, waves, pairs)]
        velocities = {touch.target: waves[touch.target].velocity.reshape(-1) for touch in touches}
        for touch in touches:
            patch = _patch(touch, waves[touch.target], velocities[touch.target])
            if patch is not None and patch.velocity > 0:
                self._exchange(data, touch, patch)
        data.xfrc_applied += self._applied

    def _exchange(self, data: mujoco.MjData, touch: Touch, patch: _Patch) -> None:
        model, point, normal = self._model, touch.point, touch.normal
        body, base = int(model.geom_bodyid[touch.other]), int(model.geom_bodyid[touch.target])
        along = normal @ (_jacobian(model, data, body, point) - _jacobian(model, data, base, point))
        response = np.zeros((1, model.nv))
        mujoco.mj_solveM(model, data, response, along[None])
        inverse_mass = float(along @ response[0])
        approach = patch.velocity - max(0.0, float(along @ data.qvel))
        if inverse_mass <= 0 or approach <= 0:
            return
        force = approach / (1 / patch.mass + inverse_mass) / model.opt.timestep
        for index, sign in ((body, 1.0), (base, -1.0)):
            if index:
                self._applied[index, :3] += sign * force * normal
                self._applied[index, 3:] += sign * force * np.cross(point - data.xipos[index], normal)
        self._loads.append((touch.target, Load(patch.shares.texels, force * patch.shares.forces)))


def _patch(touch: Touch, waves: WaveSolver, velocity: NDArray[np.float32]) -> _Patch | None:
    """The patch under a touch, from the velocity of all texels [m/s], [C n n]; None where nothing is movable."""
    mass = waves.operator.mass.reshape(-1)
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
