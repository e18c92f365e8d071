"""`Hand`: the pointer that drags a body, by a spring and a damper."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

# Frequency of the spring [1/s]; it is damped critically.
_FREQUENCY = 12.0


class _Grip(NamedTuple):
    body: int
    place: NDArray[np.float64]  # where it is held, in its frame [m]
    goal: NDArray[np.float64]  # where that place is pulled to, in the world [m]


class Hand:
    """Drags one body at a time, whose weight it carries.

    It writes the body's row of `data.xfrc_applied`, and zeros when it lets go.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._grip: _Grip | None = None

    def hold(self, data: mujoco.MjData, body: int, place: ArrayLike, goal: ArrayLike) -> None:
        """Pull a place of a body [m], in its frame, to a goal [m] in the world from now on.

        Raises `ValueError` if there is no such body.
        """
        if not 0 < body < self._model.nbody:
            raise ValueError(f"body must be a number from 1 to {self._model.nbody - 1}, got {body}")
        if self._grip is not None and self._grip.body != body:
            self.let_go(data)
        self._grip = _Grip(body, np.asarray(place, np.float64), np.asarray(goal, np.float64))

    def let_go(self, data: mujoco.MjData) -> None:
        """End the pull."""
        if self._grip is not None:
            data.xfrc_applied[self._grip.body] = 0
        self._grip = None

    def pull(self, data: mujoco.MjData) -> None:
        """Set the force for the coming steps."""
        if self._grip is None:
            return
        body, place, goal = self._grip
        arm = data.xmat[body].reshape(3, 3) @ place
        point = data.xpos[body] + arm
        motion = np.zeros(6)  # angular, then linear velocity of the body's frame, in the world
        mujoco.mj_objectVelocity(self._model, data, mujoco.mjtObj.mjOBJ_XBODY, body, motion, 0)
        velocity = motion[3:] + np.cross(motion[:3], arm)
        spring = _FREQUENCY**2 * (goal - point) - 2 * _FREQUENCY * velocity
        force = self._model.body_subtreemass[body] * (spring - self._model.opt.gravity)
        torque = np.cross(point - data.xipos[body], force)
        data.xfrc_applied[body] = [*force, *torque]
