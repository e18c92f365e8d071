"""Contact forces are read only where MuJoCo has solved for them."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

# The order of a loop's calls shows as soon as something moves: so many steps are looked at then, later one in so many.
_FIRST, _EVERY = 5, 20
# Movement within a step, in radians or metres, that shows in the poses whatever their scale.
_MOVES = 1e-8

UNSOLVED_WARNING = (
    "`Ripples.step` was called between `mj_step1` and `mj_step2`, before MuJoCo had solved for the contact forces: "
    "they are solved for with the controls as they are, and may differ from those of the coming `mj_step2`; call "
    "`step` between `mj_step2` and `mj_step1`, or take steps within `with ripples.following(data):`"
)


class SolvedForces:
    """Finds data whose contact forces belong to its contacts.

    After `mj_step`, or `mj_step1` and `mj_step2`, poses, contacts and their forces are those at the beginning of the
    step. But a loop that ends with `mj_step1` has moved on to the poses and contacts of the next step, and the forces
    beside them mean nothing until `mj_step2`.

    Parameters
    ----------
    model : mujoco.MjModel
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._poses = mujoco.MjData(model)
        self._steps = 0
        self._completed: mujoco.MjData | None = None

    def of(self, data: mujoco.MjData) -> tuple[mujoco.MjData, bool]:
        """Data with solved forces, and whether those of `data` were not.

        That is `data` itself, or, from the first time on that `data` has moved on to the next step, a copy of it,
        completed as `mj_step2` will do with the controls as they are. Forces that are solved already, as after
        `mj_forward`, come out the same.
        """
        if self._completed is None:
            if not self._moved_on(data):
                return data, False
            self._completed = copy.copy(data)
        if not data.nefc:
            return data, False
        model = self._model
        mujoco.mj_copyData(self._completed, model, data)
        mujoco.mj_fwdActuation(model, self._completed)
        mujoco.mj_fwdAcceleration(model, self._completed)
        mujoco.mj_fwdConstraint(model, self._completed)
        return self._completed, not _solved(model, data)

    def _moved_on(self, data: mujoco.MjData) -> bool:
        """Whether the poses are already those that follow from the positions."""
        if self._steps >= _FIRST:
            self._steps += 1
            if self._steps % _EVERY:
                return False
        if not (self._model.nv and np.abs(data.qvel).max() * self._model.opt.timestep > _MOVES):
            return False
        self._steps += self._steps < _FIRST
        poses = self._poses
        poses.qpos, poses.mocap_pos, poses.mocap_quat = data.qpos, data.mocap_pos, data.mocap_quat
        mujoco.mj_kinematics(self._model, poses)
        return np.array_equal(poses.xpos, data.xpos) and np.array_equal(poses.xquat, data.xquat)


def _solved(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Whether the forces f give on the Jacobian J what MuJoCo solved for, J^T f."""
    force = np.zeros(model.nv)
    mujoco.mj_mulJacTVec(model, data, force, data.efc_force)
    expected = data.qfrc_constraint
    # the sums may be made in another order
    return float(np.abs(force - expected).max()) <= 1e-9 * (1.0 + float(np.abs(expected).max()))
