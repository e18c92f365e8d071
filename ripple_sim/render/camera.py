"""The cameras that a user names, and the viewpoint that each stands for.

`Camera` is MuJoCo's free camera, `FixedCamera` a camera with a given pose. `find_viewpoint` takes
either, or a camera of a MuJoCo model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import mujoco
import numpy as np

from ripple_sim.solver.errors import RippleError, shown

from .mujoco_cameras import (
    MIN_FOCUS_DISTANCE,
    mujoco_camera,
    pose_in_mujoco,
    pose_of_mjcf_camera,
    with_camera_poses,
)
from .pose import Pose


@dataclass(frozen=True)
class Camera:
    """MuJoCo's free camera, which looks at a point.

    Attributes
    ----------
    lookat : tuple of float
        Point that the camera looks at, in the world [m].
    distance : float
        Distance from the point [m].
    azimuth : float
        Direction of view about the vertical [degrees]: along +x at 0, along +y at 90.
    elevation : float
        Elevation of the direction of view [degrees]; a negative elevation looks down.
    fovy : float
        Vertical field of view [degrees].
    """

    lookat: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float
    fovy: float = 45.0

    def __post_init__(self) -> None:
        try:
            values = np.array(
                [*self.lookat, self.distance, self.azimuth, self.elevation, self.fovy]
            )
        except (TypeError, ValueError):  # no sequence, or sequences instead of numbers
            values = np.array(None)
        valid = values.shape == (7,) and values.dtype.kind in "iuf" and np.isfinite(values).all()
        if not (valid and self.distance > 0 and 0 < self.fovy < 180):
            raise RippleError(
                f"camera {shown(self)} is invalid: lookat must be three numbers, every number "
                "finite, the distance positive [m], and fovy between 0 and 180 degrees"
            )

    def pose(self) -> Pose:
        """Return the camera's pose in the world."""
        azimuth, elevation = np.radians([self.azimuth, self.elevation])
        forward = np.array(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ]
        )
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        rotation = np.stack([right, np.cross(right, forward), -forward], axis=1)
        position = np.asarray(self.lookat) - self.distance * forward
        return Pose(position, rotation, self.distance, self.fovy)

    @staticmethod
    def from_mjcf(model: Any, data: Any, name: str | int) -> FixedCamera:
        """Return a camera of a MuJoCo model, by its name or its id, at its pose in `data`.

        Raises
        ------
        SceneError
            If the model has no such camera.
        """
        return pose_of_mjcf_camera(model, data, name)


# A camera with a given pose, such as one that a MuJoCo model fixes to a body.
FixedCamera: TypeAlias = Pose


# Both have a method `pose()`. The renderer takes any object with such a method as a viewpoint.
Viewpoint: TypeAlias = Camera | Pose


def find_viewpoint(model: mujoco.MjModel, data: mujoco.MjData, camera: Any) -> Viewpoint:
    """Return the viewpoint for a camera that is given in any way, at its pose in `data`.

    MuJoCo's cameras show the same view as in MuJoCo, including parallel rays, intrinsics and clip
    planes.

    Parameters
    ----------
    camera : Viewpoint, str, int or mujoco.MjvCamera
        A viewpoint; the name or the id of a camera in the MJCF; -1 for MuJoCo's free camera, which
        looks at the model's middle; or an `MjvCamera` that is free, tracks a body or is fixed.

    Raises
    ------
    SceneError
        If `camera` is anything else, or names a camera or body that the model does not have.
    """
    if callable(getattr(camera, "pose", None)):
        return camera
    camera = mujoco_camera(model, camera)
    if camera.type == mujoco.mjtCamera.mjCAMERA_FIXED:
        return Camera.from_mjcf(model, data, camera.fixedcamid)
    if camera.type == mujoco.mjtCamera.mjCAMERA_TRACKING:
        data = with_camera_poses(model, data)
    distance = max(camera.distance, MIN_FOCUS_DISTANCE * model.stat.extent)
    return pose_in_mujoco(model, data, camera, distance)
