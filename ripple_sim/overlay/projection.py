"""Projection of points of the scene onto a frame, and their visibility."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Pose

_SHOWN_GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)
_TOUCHING = 0.004  # a geom in front of a point by this share of the distance does not hide it


class Projection:
    """The camera of one frame.

    Parameters
    ----------
    pose : Pose
        Of the camera.
    width, height : int
        Of the frame [pixels].
    """

    def __init__(self, pose: Pose, width: int, height: int) -> None:
        self._pose, self._middle = pose, np.array([width / 2, height / 2])
        self._focal = height / 2 / np.tan(np.radians(pose.fovy) / 2)

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels [k, 2] of points [k, 3] in the world: x to the right, y down; NaN behind the camera."""
        local = (points - self._pose.position) @ self._pose.rotation
        depth = np.where(local[:, 2:] < 0, -local[:, 2:], np.nan)
        return self._middle + self._focal * local[:, :2] * [1.0, -1.0] / depth

    def metres(self, point: NDArray[np.float64]) -> float:
        """Length [m] of a pixel at a point's distance."""
        return float((self._pose.position - point) @ self._pose.rotation[:, 2]) / self._focal

    def seen(self, model: Any, data: Any, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether no geom of a MuJoCo model, its targets undeformed, hides points [k, 3] in the world."""
        eye, hit = self._pose.position, np.zeros(1, np.int32)
        ways = points - eye
        reach = np.array([mujoco.mj_ray(model, data, eye, way, _SHOWN_GROUPS, 1, -1, hit) for way in ways])
        return (reach < 0) | (reach > 1 - _TOUCHING)
