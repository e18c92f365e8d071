"""`SolvedForces` finds MuJoCo data whose contact forces belong to its contacts."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
from numpy.typing import NDArray

# Value of MuJoCo's `contact.exclude` for contacts that have rows in the constraint solver.
_HAS_ROWS = 0

# Forces found from accelerations are those of the step if their sums on the bodies agree with
# MuJoCo's up to this share of the largest sum.
_RESTORED_TOLERANCE = 1e-3

# Forces were solved already if their sums on the bodies agree up to this share: the sums may be
# taken in another order.
_SAME_SUM = 1e-9

# The order of a loop's calls shows as soon as something moves. So many moving steps are checked
# first, and later one step in so many.
_CHECKED_STEPS = 5
_CHECK_INTERVAL = 20

# Movement within a step, in radians or metres, that shows in the poses whatever their scale.
_MIN_MOVEMENT = 1e-8

UNSOLVED_WARNING = (
    "`Ripples.step` was called between `mj_step1` and `mj_step2`, before MuJoCo had solved for the "
    "contact forces: they are solved for with the controls as they are, and may differ from those "
    "of the coming `mj_step2`; call `step` between `mj_step2` and `mj_step1`, or take steps within "
    "`with ripples.following(data):`"
)
LOST_WARNING = (
    "the contact forces of the latest physics step were gone when `Ripples.step` was called: "
    "`mj_collision`, called after `mj_step`, throws them away; those of the coming step are taken "
    "in their place, so that hits begin too late; call `step` right after `mj_step`, or take steps "
    "with `ripples.mj_step(data)`"
)


class SolvedForces:
    """Finds data whose contact forces belong to its contacts.

    After `mj_step`, or `mj_step1` and `mj_step2`, poses, contacts and their forces are those at the
    beginning of the step. But a loop that ends with `mj_step1` has moved on to the poses and
    contacts of the next step, and the forces beside them mean nothing until `mj_step2`. After
    `mj_collision` there are contacts, but no forces.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        # scratch for the poses that follow from the positions
        self._poses = mujoco.MjData(model)
        # steps that were checked so far for the order of the loop's calls
        self._steps = 0
        # whether the data was ever seen after `mj_step1`, that is, moved on to the next step
        self._has_moved_on = False
        # a copy of the data, once it is needed
        self._completed: mujoco.MjData | None = None

    def find(self, data: mujoco.MjData) -> tuple[mujoco.MjData, str | None]:
        """Data with solved forces, and a warning if the forces are those of the coming step.

        This is `data` itself until `data` is first seen to have moved on to the next step. From
        then on it is a copy, completed as `mj_step2` will do with the present controls. Forces that
        are solved already, as after `mj_forward`, come out the same. If forces are lost, the copy
        has them as they were, if they can be found.
        """
        model = self._model
        lost = _are_lost(data)
        self._has_moved_on = self._has_moved_on or self._moved_on(data)
        if not lost and not (self._has_moved_on and data.nefc):
            return data, None
        if self._completed is None:
            self._completed = copy.copy(data)
        mujoco.mj_copyData(self._completed, model, data)
        if lost:
            if _restore_forces(model, self._completed):
                return self._completed, None
            mujoco.mj_copyData(self._completed, model, data)
            mujoco.mj_fwdPosition(model, self._completed)
            mujoco.mj_fwdVelocity(model, self._completed)
        mujoco.mj_fwdActuation(model, self._completed)
        mujoco.mj_fwdAcceleration(model, self._completed)
        mujoco.mj_fwdConstraint(model, self._completed)
        if lost:
            return self._completed, LOST_WARNING
        # forces f that were solved already give J^T f on the bodies, with the Jacobian J
        force = np.zeros(model.nv)
        mujoco.mj_mulJacTVec(model, data, force, data.efc_force)
        are_solved = _agree(force, data.qfrc_constraint, _SAME_SUM)
        return self._completed, None if are_solved else UNSOLVED_WARNING

    def _moved_on(self, data: mujoco.MjData) -> bool:
        """Whether the poses are already those that follow from the positions."""
        if self._steps >= _CHECKED_STEPS:
            self._steps += 1
            if self._steps % _CHECK_INTERVAL:
                return False
        if not self._model.nv:
            return False
        movement = np.abs(data.qvel).max() * self._model.opt.timestep
        if not movement > _MIN_MOVEMENT:
            return False
        if self._steps < _CHECKED_STEPS:
            self._steps += 1
        poses = self._poses
        poses.qpos = data.qpos
        poses.mocap_pos = data.mocap_pos
        poses.mocap_quat = data.mocap_quat
        mujoco.mj_kinematics(self._model, poses)
        return np.array_equal(poses.xpos, data.xpos) and np.array_equal(poses.xquat, data.xquat)


def _restore_forces(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Find the forces of the latest step from its acceleration; return whether that succeeded.

    It succeeds where `mj_collision` found the contacts anew at the poses of that step: the sums of
    the forces on the bodies are then those that MuJoCo solved for.
    """
    expected = data.qfrc_constraint.copy()
    data.qvel -= model.opt.timestep * data.qacc
    mujoco.mj_makeConstraint(model, data)
    mujoco.mj_island(model, data)
    mujoco.mj_projectConstraint(model, data)
    mujoco.mj_referenceConstraint(model, data)
    excess = np.zeros(data.nefc)
    mujoco.mj_mulJacVec(model, data, excess, data.qacc)
    mujoco.mj_constraintUpdate(model, data, excess - data.efc_aref, None, 0)
    return _agree(data.qfrc_constraint, expected, _RESTORED_TOLERANCE)


def _are_lost(data: mujoco.MjData) -> bool:
    """Whether contacts should have rows of the constraint solver, and there are none."""
    return bool(not data.nefc and data.ncon and (data.contact.exclude == _HAS_ROWS).any())


def _agree(force: NDArray[np.float64], expected: NDArray[np.float64], tolerance: float) -> bool:
    """Whether forces differ by no more than a share of the largest one expected."""
    difference = float(np.abs(force - expected).max())
    largest = float(np.abs(expected).max())
    return difference <= tolerance * (1.0 + largest)
