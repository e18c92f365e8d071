"""Cameras: MuJoCo's free camera, a camera fixed in the model, or a point of its lens."""

from __future__ import annotations

import dataclasses
import numbers
from dataclasses import dataclass
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import RippleError


@dataclass(frozen=True)
class Pose:
    """A camera in the world.

    `rotation` has the columns right, up and backwards (a camera looks along -z, as in OpenGL and MuJoCo), `distance` is
    that of the focus, the point that the camera is about [m], and `fovy` the vertical field of view [degrees]. The eye
    may be off the camera's position, at a point of the `lens` (to the right, up) [m]: points of the plane at the
    `focal_distance` [m] then stay where they are in the frame.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    distance: float
    fovy: float
    lens: tuple[float, float] = (0.0, 0.0)
    focal_distance: float = np.inf

    @property
    def eye(self) -> NDArray[np.float64]:
        """Where rays start [m], shape [3]."""
        return self.position + self.rotation[:, :2] @ self.lens

    @property
    def shear(self) -> NDArray[np.float64]:
        """How far the ray through the middle of the frame goes right and up, a metre in front of the eye."""
        return -np.divide(self.lens, self.focal_distance)

    @property
    def focus(self) -> NDArray[np.float64]:
        """Point that the camera is about [m], shape [3]."""
        return self.position - self.distance * self.rotation[:, 2]


class Viewpoint(Protocol):
    """Anything that has a `pose()`."""

    def pose(self) -> Pose:
        """Return position and axes in the world."""


@dataclass(frozen=True)
class Camera:
    """MuJoCo's free camera: looks at a point from a distance [m], at an azimuth and an elevation [degrees].

    At azimuth 0 it looks along +x, at 90 along +y; a negative elevation looks down.
    """

    lookat: tuple[float, float, float]
    distance: float
    azimuth: float
    elevation: float
    fovy: float = 45.0

    def __post_init__(self) -> None:
        numbers = (*self.lookat, self.distance, self.azimuth, self.elevation, self.fovy)
        if not (np.all(np.isfinite(numbers)) and self.distance > 0 and 0 < self.fovy < 180):
            raise RippleError(
                f"camera {self} is invalid: every number must be finite, the distance positive [m], "
                "and fovy between 0 and 180 degrees"
            )

    def pose(self) -> Pose:
        """Return position and axes in the world."""
        azimuth, elevation = np.radians([self.azimuth, self.elevation])
        forward = np.array(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        )
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        rotation = np.stack([right, np.cross(right, forward), -forward], axis=1)
        return Pose(np.asarray(self.lookat) - self.distance * forward, rotation, self.distance, self.fovy)

    @staticmethod
    def from_mjcf(model: Any, data: Any, name: str | int) -> FixedCamera:
        """Return a camera of a MuJoCo model, by its name or its id, as posed in `data`.

        Raises
        ------
        SceneError
            If the model has no such camera.
        """
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, name) if isinstance(name, str) else name
        if not 0 <= index < model.ncam:
            names = ", ".join(f"{model.camera(i).name!r} (id {i})" for i in range(model.ncam)) or "none"
            raise SceneError(f"the model has no camera {name!r}; it has: {names}")
        return FixedCamera(
            position=np.array(data.cam_xpos[index]),
            rotation=np.array(data.cam_xmat[index]).reshape(3, 3),
            distance=float(max(np.linalg.norm(data.cam_xpos[index] - model.stat.center), 1e-3 * model.stat.extent)),
            fovy=float(model.cam_fovy[index]),
        )


@dataclass(frozen=True)
class FixedCamera:
    """A camera with a given pose, such as one that a MuJoCo model fixes to a body."""

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    distance: float
    fovy: float = 45.0

    def pose(self) -> Pose:
        """Return position and axes in the world."""
        return Pose(self.position, self.rotation, self.distance, self.fovy)


@dataclass(frozen=True)
class ThroughLens:
    """A camera whose eye is at a point of its lens (to the right, up) [m], focused on a distance [m]."""

    camera: Viewpoint
    lens: tuple[float, float]
    focal_distance: float

    def pose(self) -> Pose:
        """Return position and axes in the world."""
        return dataclasses.replace(self.camera.pose(), lens=self.lens, focal_distance=self.focal_distance)


def find_viewpoint(model: mujoco.MjModel, data: mujoco.MjData, camera: Any) -> Viewpoint:
    """The viewpoint of whatever stands for a camera, as posed in `data`.

    Parameters
    ----------
    model : mujoco.MjModel
    data : mujoco.MjData
    camera : Viewpoint, str, int or mujoco.MjvCamera
        A viewpoint itself; the name or the id of a camera in the MJCF; -1 for MuJoCo's free camera, aimed at the
        model's middle; or a camera of MuJoCo's that is free, tracks a body or is fixed.

    Raises
    ------
    SceneError
        If it is anything else, or names what the model does not have.
    """
    if callable(getattr(camera, "pose", None)):
        return camera
    if isinstance(camera, numbers.Integral):
        if camera != -1:
            return Camera.from_mjcf(model, data, int(camera))
        free = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, free)
        free.orthographic = 0
        return _placed(model, data, free)
    if isinstance(camera, str):
        return Camera.from_mjcf(model, data, camera)
    if isinstance(camera, mujoco.MjvCamera):
        return _placed(model, data, camera)
    raise SceneError(
        f"camera is {type(camera).__name__}; valid are a Camera, a FixedCamera, the name or the id of a camera in the "
        "model, -1 for the free camera, and a mujoco.MjvCamera"
    )


def _placed(model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera) -> Viewpoint:
    """A camera of MuJoCo's where `mjv_updateCamera` places it."""
    kinds = mujoco.mjtCamera
    if camera.type == kinds.mjCAMERA_FIXED:
        return Camera.from_mjcf(model, data, camera.fixedcamid)
    if camera.orthographic:
        raise SceneError("the MjvCamera is orthographic; valid is one in perspective: set its orthographic to 0")
    lookat = camera.lookat
    if camera.type == kinds.mjCAMERA_TRACKING:
        if not 0 <= camera.trackbodyid < model.nbody:
            raise SceneError(
                f"the MjvCamera's trackbodyid is {camera.trackbodyid}; valid are 0 to {model.nbody - 1}, the model's "
                "bodies"
            )
        lookat = data.subtree_com[camera.trackbodyid]
    elif camera.type != kinds.mjCAMERA_FREE:
        raise SceneError(
            f"the MjvCamera's type is {camera.type}; valid are mjCAMERA_FREE ({int(kinds.mjCAMERA_FREE)}), "
            f"mjCAMERA_TRACKING ({int(kinds.mjCAMERA_TRACKING)}) and mjCAMERA_FIXED ({int(kinds.mjCAMERA_FIXED)})"
        )
    x, y, z = (float(each) for each in lookat)
    return Camera(
        (x, y, z), float(camera.distance), float(camera.azimuth), float(camera.elevation), model.vis.global_.fovy
    )
