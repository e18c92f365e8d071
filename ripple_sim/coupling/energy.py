"""The energy of bodies and waves together, as their schemes conserve it, and MuJoCo's own scheme for new forces."""

from __future__ import annotations

import copy
from typing import NamedTuple

import mujoco
import numpy as np

from ripple_sim.solver.kernel import Floats


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


_INTEGRATORS = mujoco.mjtIntegrator
# Rounds in which the velocity at the beginning of a step is found from that at its end.
_ROUNDS = 3


class VelocityChange:
    """What other contact forces would have changed in the velocities after a step.

    MuJoCo's integrators are implicit in joint damping, and some in the gyroscopic terms of what spins: velocities then
    change by another mass matrix than accelerations tell, and forces that are taken back would leave a rest behind.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._scratch: mujoco.MjData | None = None
        self._latest: Floats | None = None

    def note(self, data: mujoco.MjData) -> None:
        """Take the velocities with which the next step begins, unless somebody changes them."""
        self._latest = data.qvel.copy()

    def __call__(self, data: mujoco.MjData, qacc: Floats, force: Floats, *, pending: bool) -> Floats:
        """Change of velocities [nv].

        Parameters
        ----------
        data : mujoco.MjData
            With the new accelerations and constraint forces.
        qacc, force : float64 [nv]
            The old ones.
        pending : bool
            Whether the velocities are those before the step.
        """
        dt, integrator = self._model.opt.timestep, self._model.opt.integrator
        if integrator in (_INTEGRATORS.mjINT_IMPLICIT, _INTEGRATORS.mjINT_IMPLICITFAST):
            integrate = mujoco.mj_implicit
        elif integrator == _INTEGRATORS.mjINT_EULER and self._model.dof_damping.any():
            integrate = mujoco.mj_Euler
        else:
            return np.asarray(dt * (data.qacc - qacc))
        if self._scratch is None:
            self._scratch = copy.copy(data)
        scratch = self._scratch

        def end(start: Floats, acceleration: Floats, forces: Floats) -> Floats:
            mujoco.mj_copyData(scratch, self._model, data)
            scratch.qvel[:], scratch.qacc[:], scratch.qfrc_constraint[:] = start, acceleration, forces
            integrate(self._model, scratch)
            return scratch.qvel.copy()

        start = data.qvel if pending else self._latest if self._latest is not None else data.qvel - dt * qacc
        old = end(start, qacc, force)
        for _ in range(0 if pending else _ROUNDS):
            if np.array_equal(old, data.qvel):
                break
            start = start + data.qvel - old
            old = end(start, qacc, force)
        return end(start, data.qacc, data.qfrc_constraint) - old
