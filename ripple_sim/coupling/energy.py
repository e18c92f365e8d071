"""The energy of bodies and waves together, as their schemes conserve it."""

from __future__ import annotations

from typing import NamedTuple

import mujoco


class Energy(NamedTuple):
    """Energy of a simulation [J].

    Attributes
    ----------
    bodies : float
        Kinetic and potential energy, of gravity and of springs; see `BodyEnergy`.
    waves : float
        Of all targets, see `WaveSolver.energy`.
    """

    bodies: float
    waves: float

    @property
    def total(self) -> float:
        """Of both [J]."""
        return self.bodies + self.waves


class BodyEnergy:
    """Kinetic and potential energy of MuJoCo's bodies, at one time.

    MuJoCo's semi-implicit steps leave velocities half a step behind positions. The potential is taken half a step back:
    under uniform gravity the sum is then constant to round-off, while that of `mujoco.mj_energyPos` and `mj_energyVel`
    differs on the way up from that on the way down. With the integrator RK4 both are of the same time already.

    Parameters
    ----------
    model : mujoco.MjModel
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model, self._scratch = model, mujoco.MjData(model)

    def __call__(self, data: mujoco.MjData) -> float:
        """Energy [J]; `data` stays as it is."""
        model, scratch = self._model, self._scratch
        for name in ("qpos", "qvel", "mocap_pos", "mocap_quat"):
            getattr(scratch, name)[:] = getattr(data, name)
        self._update()
        mujoco.mj_makeM(model, scratch)
        mujoco.mj_energyVel(model, scratch)
        if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
            mujoco.mj_integratePos(model, scratch.qpos, scratch.qvel, -model.opt.timestep / 2)
            self._update()
        mujoco.mj_energyPos(model, scratch)
        return float(scratch.energy.sum())

    def _update(self) -> None:
        for update in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_flex, mujoco.mj_tendon):
            update(self._model, self._scratch)
