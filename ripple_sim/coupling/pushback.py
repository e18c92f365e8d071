"""Two-way coupling: where the surface moves outwards under a body, it pushes the body, and is held back by it."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import WaveSolver

from .contacts import ContactPair

Load = tuple[NDArray[np.int64], NDArray[np.float64]]


class PushBack:
    """Forces between moving surfaces and the bodies that touch them, held over the next physics step.

    MuJoCo sees a target's undeformed surface, which stops what comes in. So only the surface's own outward motion is
    left to pass on: a patch of mass m_s that moves outwards at u meets a body of effective mass m_b that moves along
    the normal at w >= 0, both seen from the target. As in a perfectly inelastic collision, which cannot create energy,
    they exchange J = (u - w) m_s m_b / (m_s + m_b) if u > w: +J on the body, -J on the surface and on the target's
    body.

    Parameters
    ----------
    model : mujoco.MjModel
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._applied = np.zeros((model.nbody, 6))
        self.loads: dict[int, list[Load]] = {}

    def withdraw(self, data: mujoco.MjData) -> dict[int, list[Load]]:
        """Take back the forces on the bodies, and give those on the targets' texels over the step just made [N]."""
        data.xfrc_applied -= self._applied
        return self.forget()

    def forget(self) -> dict[int, list[Load]]:
        """As `withdraw`, where MuJoCo has cleared its forces already."""
        self._applied[:] = 0
        loads, self.loads = self.loads, {}
        return loads

    def apply(self, data: mujoco.MjData, contacts: list[tuple[ContactPair, WaveSolver, Load]]) -> None:
        """Set the forces for the next step, from pairs that touch and the share of each texel in their contact."""
        velocities = {pair.target: waves.velocity.reshape(-1) for pair, waves, _ in contacts}
        for pair, waves, (texels, shares) in contacts:
            mass = waves.operator.mass.reshape(-1)[texels]
            if not (shares**2).any():
                continue
            patch_mass = 1 / float((shares**2 / mass).sum())
            outward = float(shares @ velocities[pair.target][texels])
            if outward > 0:
                self._exchange(data, pair, patch_mass, outward, (texels, shares))
        data.xfrc_applied += self._applied

    def _exchange(self, data: mujoco.MjData, pair: ContactPair, patch_mass: float, outward: float, where: Load) -> None:
        model = self._model
        point = pair.forces @ pair.points / pair.forces.sum()
        normal = pair.forces @ pair.normals
        normal /= np.linalg.norm(normal)
        body, base = int(model.geom_bodyid[pair.other]), int(model.geom_bodyid[pair.target])
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
        texels, shares = where
        self.loads.setdefault(pair.target, []).append((texels, force * shares))


def _jacobian(model: mujoco.MjModel, data: mujoco.MjData, body: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocity of a body's point over qvel, [3, nv]."""
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, point, body)
    return jacobian
