"""Cameras and what they see of the world.

MuJoCo's free camera and cameras fixed in a model, which have a pose; matrices of view and projection, for column
vectors, in OpenGL's conventions; and bounding balls, with the boxes about them in a frame. Balls are float64 [k, 4]:
centre in the world and radius [m], which may be infinite.
"""

from __future__ import annotations

import numbers
from dataclasses import dataclass
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import RippleError, shown


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
    fovy: float = 45.0
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

    def pose(self) -> Pose:
        """Itself: a pose is a viewpoint."""
        return self

    @property
    def focus(self) -> NDArray[np.float64]:
        """Point that the camera is about [m], shape [3]."""
        return self.position - self.distance * self.rotation[:, 2]


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
        try:
            values = np.array([*self.lookat, self.distance, self.azimuth, self.elevation, self.fovy])
        except (TypeError, ValueError):  # no sequence, or sequences in place of numbers
            values = np.array(None)
        valid = values.shape == (7,) and values.dtype.kind in "iuf" and np.isfinite(values).all()
        if not (valid and self.distance > 0 and 0 < self.fovy < 180):
            raise RippleError(
                f"camera {shown(self)} is invalid: lookat must be three numbers, every number finite, the distance "
                "positive [m], and fovy between 0 and 180 degrees"
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
        position, rotation = np.array(data.cam_xpos[index]), np.array(data.cam_xmat[index]).reshape(3, 3)
        distance = float(max(np.linalg.norm(position - model.stat.center), 1e-3 * model.stat.extent))
        return FixedCamera(position, rotation, distance, fovy=float(model.cam_fovy[index]))


# A camera with a given pose, such as one that a MuJoCo model fixes to a body.
FixedCamera: TypeAlias = Pose

# Both have a `pose()`; where the renderer takes a viewpoint, anything that has one will do.
Viewpoint: TypeAlias = Camera | Pose


def find_viewpoint(model: mujoco.MjModel, data: mujoco.MjData, camera: Any) -> Viewpoint:
    """The viewpoint of whatever stands for a camera, as posed in `data`.

    Parameters
    ----------
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
        camera = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(model, camera)
        camera.orthographic = 0
    if isinstance(camera, str):
        return Camera.from_mjcf(model, data, camera)
    if not isinstance(camera, mujoco.MjvCamera):
        raise SceneError(
            f"camera is {type(camera).__name__}; valid are a Camera, a FixedCamera, the name or the id of a camera in "
            "the model, -1 for the free camera, and a mujoco.MjvCamera"
        )
    kinds = mujoco.mjtCamera  # a camera of MuJoCo's is where `mjv_updateCamera` places it
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
    x, y, z, distance, azimuth, elevation = map(float, (*lookat, camera.distance, camera.azimuth, camera.elevation))
    return Camera((x, y, z), distance, azimuth, elevation, model.vis.global_.fovy)


def view_matrix(pose: Pose) -> NDArray[np.float64]:
    """World to eye coordinates, shape [4, 4]."""
    return view_along(pose.rotation.T, pose.rotation.T @ pose.eye)


def view_along(rotation: NDArray[np.float64], eye: NDArray[np.float64]) -> NDArray[np.float64]:
    """World to eye coordinates, shape [4, 4]; `eye` is the eye's position along the rows of `rotation`."""
    return np.block([[rotation, -eye[:, None]], [np.array([0.0, 0.0, 0.0, 1.0])]])


def perspective(
    fovy: float, aspect: float, near: float, far: float, shear: ArrayLike = (0.0, 0.0)
) -> NDArray[np.float64]:
    """Eye to clip coordinates, shape [4, 4].

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
    matrix = np.diag([1 / half_width, 1 / half_width, -2 / depth, 1.0])
    matrix[2, 3] = -1.0
    return matrix


def within(balls: NDArray[np.float64], point: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """The balls that any point within `reach` [m] of a point [3] touches."""
    return balls[np.linalg.norm(balls[:, :3] - point, axis=1) - balls[:, 3] < reach]


def enclosing(balls: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre [3] and radius of a ball that contains others."""
    centres, radii = balls[:, :3], balls[:, 3]
    centre = ((centres - radii[:, None]).min(axis=0) + (centres + radii[:, None]).max(axis=0)) / 2
    return centre, float((np.linalg.norm(centres - centre, axis=1) + radii).max())


def balls_about(triangles: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Balls that each contain a share of some triangles, which are close together.

    Parameters
    ----------
    triangles : array, shape [m, 3, 3]
        Corners [m].
    count : int
        The least number of balls, unless there are fewer triangles.
    """
    groups = [triangles]
    while len(groups) < min(count, len(triangles)):
        halves = []
        for group in groups:
            middles = group.mean(axis=1)
            order = np.argsort(middles[:, np.ptp(middles, axis=0).argmax()], kind="stable")
            halves += [group[half] for half in np.array_split(order, 2) if len(half)]
        groups = halves
    corners = [group.reshape(-1, 3) for group in groups]
    centres = np.array([(each.min(axis=0) + each.max(axis=0)) / 2 for each in corners])
    radii = [np.linalg.norm(each - centre, axis=1).max() for each, centre in zip(corners, centres, strict=True)]
    return np.column_stack([centres, radii])


_CLOSEST = 0.01  # gap between the eye and a ball, in radii, below which it may show anywhere


def boxes_of(balls: NDArray[np.float64], pose: Pose, size: tuple[int, int]) -> NDArray[np.int64]:
    """Boxes about balls in a frame of a size (width, height) [pixels].

    Returns
    -------
    int64 [k, 4]
        Left, lower, right and upper edge [pixels], counted from the lower left. Balls behind the camera have a box of
        size 0.
    """
    centres, radii = balls[:, :3], balls[:, 3]
    local = (centres - pose.eye) @ pose.rotation
    middle = -local[:, 2]
    near, far = middle - radii, middle + radii
    seen = near > _CLOSEST * radii
    scale = size[1] / (2 * np.tan(np.radians(pose.fovy) / 2))
    # the nearest point of the ball's box is seen under the widest angle
    corners = np.stack(
        [(local[seen, :2] + side * radii[seen, None]) / depth[seen, None] for side in (-1, 1) for depth in (near, far)]
    )
    origin = np.array(size) / 2 - scale * pose.shear
    boxes = np.tile([0, 0, *size], (len(radii), 1))
    boxes[seen, :2] = np.clip(np.floor(origin + scale * corners.min(axis=0)), 0, size)
    boxes[seen, 2:] = np.clip(np.ceil(origin + scale * corners.max(axis=0)), 0, size)
    boxes[far <= 0] = 0
    return boxes


def scissor_of(boxes: NDArray[np.int64]) -> tuple[int, int, int, int] | None:
    """Smallest scissor (left, lower, width, height) about boxes [k, 4]; None if all are empty."""
    boxes = boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]
    if not len(boxes):
        return None
    left, lower = (int(edge) for edge in boxes[:, :2].min(axis=0))
    right, upper = (int(edge) for edge in boxes[:, 2:].max(axis=0))
    return left, lower, right - left, upper - lower
