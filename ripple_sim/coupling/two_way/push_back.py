"""Two-way coupling: where the surface moves outwards under a body, it pushes the body, and is held back by it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.load.sources import Touch
from ripple_sim.solver import Load, WaveSolver

from .reach import Hovering


class PushBack:
    """Forces between moving surfaces and the bodies that touch them, held over the next physics step.

    MuJoCo sees a target's undeformed surface, which stops what comes in. So only the surface's own outward motion is
    left to pass on, to what touches that surface and to what the displaced one reaches above it: a patch of mass m_s
    that moves outwards at u meets a body of effective mass m_b that moves along the normal at w >= 0, both seen from
    the target. As in a perfectly inelastic collision, which cannot create energy, they exchange
    J = (u - w) m_s m_b / (m_s + m_b) if u > w: +J on the body, -J on the surface and on the target's body.

    Parameters
    ----------
    model : mujoco.MjModel
    targets : iterable of int
        Geom ids.
    """

    def __init__(self, model: mujoco.MjModel, targets: Iterable[int]) -> None:
        self._model = model
        self._hovering = Hovering(model, targets)
        self._applied = np.zeros((model.nbody, 6))
        self._loads: list[tuple[int, Load]] = []

    def withdraw(self, data: mujoco.MjData) -> list[tuple[int, Load]]:
        """Take back the forces on the bodies, and give those on the targets over the step just made, by geom id."""
        data.xfrc_applied -= self._applied
        return self.forget()

    def forget(self) -> list[tuple[int, Load]]:
        """As `withdraw`, where MuJoCo has cleared its forces already."""
        self._applied[:] = 0
        loads, self._loads = self._loads, []
        return loads

    def apply(self, data: mujoco.MjData, touches: Sequence[Touch], waves: Mapping[int, WaveSolver]) -> None:
        """Set the forces for the next step, from what touches and the waves of each target, by geom id."""
        pairs = {(touch.target, touch.other) for touch in touches}
        touches = [*touches, *self._hovering.reached(data, waves, pairs)]
        velocities = {touch.target: waves[touch.target].velocity.reshape(-1) for touch in touches}
        for touch in touches:
            mass = waves[touch.target].operator.mass.reshape(-1)
            load = touch.load.merged(mass.size)
            pressed = load.forces.sum()
            if pressed <= 0:
                continue
            shares = load.forces / pressed
            patch_mass = 1 / float((shares**2 / mass[load.texels]).sum())
            outward = float(shares @ velocities[touch.target][load.texels])
            if outward > 0:
                self._exchange(data, touch, patch_mass, outward, Load(load.texels, shares))
        data.xfrc_applied += self._applied

    def _exchange(self, data: mujoco.MjData, touch: Touch, patch_mass: float, outward: float, shares: Load) -> None:
        model, point, normal = self._model, touch.point, touch.normal
        body, base = int(model.geom_bodyid[touch.other]), int(model.geom_bodyid[touch.target])
        along = normal @ (_jacobian(model, data, body, point) - _jacobian(model, data, base, point))
        response = np.zeros((1, model.nv))
        mujoco.mj_solveM(model, data, response, along[None])
        inverse_mass = float(along @ response[0])
        approach = outward - max(0.0, float(along @ data.qvel))
        if inverse_mass <= 0 or approach <= 0:
            return
        force = approach / (1 / patch_mass + inverse_mass) / model.opt.timestep
        for index, sign in ((body, 1.0), (base, -1.0)):
            if index:
                self._applied[index, :3] += sign * force * normal
                self._applied[index, 3:] += sign * force * np.cross(point - data.xipos[index], normal)
        self._loads.append((touch.target, Load(shares.texels, force * shares.forces)))


def _jacobian(model: mujoco.MjModel, data: mujoco.MjData, body: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocity of a body's point over qvel, [3, nv]."""
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, point, body)
    return jacobian
