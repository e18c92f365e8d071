"""Where the picture is taken from: MuJoCo's free camera, a camera fixed in the model, or a point of its lens."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Protocol

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.solver.errors import RippleError


@dataclass(frozen=True)
class Pose:
    """A camera in the world.

    `rotation` has the columns right, up and backwards (OpenGL and MuJoCo alike: it looks along -z), `distance` [m] is
    how far away lies what the camera is about, and `fovy` the vertical field of view [degrees]. The eye may stand
    beside the camera's position, at a point of the `lens` (to the right, up) [m]: what lies in the plane at the
    `focal_distance` [m] then stays where it is in the picture.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    distance: float
    fovy: float
    lens: tuple[float, float] = (0.0, 0.0)
    focal_distance: float = np.inf

    @property
    def eye(self) -> NDArray[np.float64]:
        """The point that the picture is seen from [m], shape [3]."""
        return self.position + self.rotation[:, :2] @ self.lens

    @property
    def shear(self) -> NDArray[np.float64]:
        """Where the ray through the middle of the picture goes: to the right and up, one metre in front of the eye."""
        return -np.divide(self.lens, self.focal_distance)

    @property
    def focus(self) -> NDArray[np.float64]:
        """The point that the camera is about [m], shape [3]."""
        return self.position - self.distance * self.rotation[:, 2]


class Viewpoint(Protocol):
    """Anything that has a `pose()`."""

    def pose(self) -> Pose:
        """Return position and axes in the world."""


@dataclass(frozen=True)
class Camera:
    """MuJoCo's free camera: it looks at a point from a distance [m] under an azimuth and an elevation [degrees].

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
    def from_mjcf(model: Any, data: Any, name: str) -> FixedCamera:
        """Return the camera called `name` of a MuJoCo model, as it stands in `data`.

        Raises
        ------
        RippleError
            If the model has no such camera.
        """
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, name)
        if index < 0:
            names = ", ".join(repr(model.camera(i).name) for i in range(model.ncam)) or "none"
            raise RippleError(f"the model has no camera {name!r}; it has: {names}")
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
    """A camera whose eye stands at a point of its lens (to the right, up) [m], focused on a distance [m]."""

    camera: Viewpoint
    lens: tuple[float, float]
    focal_distance: float

    def pose(self) -> Pose:
        """Return position and axes in the world."""
        return dataclasses.replace(self.camera.pose(), lens=self.lens, focal_distance=self.focal_distance)


def view_matrix(pose: Pose) -> NDArray[np.float64]:
    """World to eye coordinates, shape [4, 4], for column vectors."""
    view = np.eye(4)
    view[:3, :3] = pose.rotation.T
    view[:3, 3] = -pose.rotation.T @ pose.eye
    return view


def perspective(
    fovy: float, aspect: float, near: float, far: float, shear: ArrayLike = (0.0, 0.0)
) -> NDArray[np.float64]:
    """Eye to clip coordinates in OpenGL's convention, shape [4, 4], for column vectors.

    `fovy` in degrees; `aspect` is width over height; `near` and `far` in metres; for `shear` see `Pose`.
    """
    scale = 1.0 / np.tan(np.radians(fovy) / 2)
    projection = np.zeros((4, 4))
    projection[0, 0] = scale / aspect
    projection[1, 1] = scale
    projection[:2, 2] = np.multiply([scale / aspect, scale], shear)
    projection[2, 2] = (near + far) / (near - far)
    projection[2, 3] = 2 * near * far / (near - far)
    projection[3, 2] = -1.0
    return projection


def orthographic(half_width: float, depth: float) -> NDArray[np.float64]:
    """Eye to clip coordinates of a square box from 0 to `depth` [m] in front of the eye, shape [4, 4]."""
    return np.diag([1 / half_width, 1 / half_width, -2 / depth, 1.0]) + np.array(
        [[0.0] * 4, [0.0] * 4, [0.0, 0.0, 0.0, -1.0], [0.0] * 4]
    )
