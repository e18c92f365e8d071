"""Cameras and what they see of the world.

MuJoCo's free camera and cameras fixed in a model, which have a pose; matrices of view and
projection, for column vectors, in OpenGL's conventions; and bounding balls, with the boxes about
them in a frame. Balls are float64 [k, 4]: centre in the world and radius [m], which may be
infinite.
"""

from __future__ import annotations

import copy
import dataclasses
import numbers
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import RippleError, shown, warn_caller

# Clip planes of a camera that says nothing of them, in its distances.
_NEAR = 0.02
_FAR = 200.0
_ROUND_OFF = 1e-4  # of MuJoCo's frustums, which have single precision, relative
_SLACK = 0.99  # of the distance of the first thing, where the near plane may be
# Least distance of the focus, in extents of the model: of a camera among what it shows; and of one
# that a body carries, which looks at what is about it.
_LEAST_FOCUS = 0.05
_LEAST_FOCUS_RIDING = 0.5
_AT_BODY = int(mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY)
_AT_MASS = int(mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODYCOM)

_CLOSEST = 0.01  # gap between the eye and a ball, in radii, below which it may show anywhere


@dataclass(frozen=True)
class Pose:
    """A camera in the world.

    Attributes
    ----------
    position : array, shape [3]
        [m].
    rotation : array, shape [3, 3]
        Its columns are right, up and backwards: a camera looks along -z, as in OpenGL and MuJoCo.
    distance : float
        Of the focus, the point that the camera is about [m].
    fovy : float
        Vertical field of view [degrees]; of an orthographic camera the height of what it sees [m].
    lens : tuple of float
        The eye may be off the camera's position, at a point of the lens (to the right, up) [m].
        Points of the plane in focus then stay where they are in the frame.
    focal_distance : float
        Of the plane in focus [m].
    orthographic : bool
        Whether rays are parallel, in place of a perspective view.
    centre : tuple of float
        Where the middle of the frame is off the camera's axis (to the right, up): a metre in front
        of the eye, or with parallel rays anywhere [m].
    half_width : float, optional
        Half the width of what is seen, there [m]; by default pixels are square.
    clip : tuple of float, optional
        Distances of the near and the far plane [m]; by default they follow the distance of the
        focus.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    distance: float
    fovy: float = 45.0
    lens: tuple[float, float] = (0.0, 0.0)
    focal_distance: float = np.inf
    orthographic: bool = False
    centre: tuple[float, float] = (0.0, 0.0)
    half_width: float | None = None
    clip: tuple[float, float] | None = None

    @property
    def eye(self) -> NDArray[np.float64]:
        """Where the ray through the middle of the frame starts [m], shape [3]; in perspective all rays do."""
        offset = np.add(self.lens, self.centre) if self.orthographic else np.asarray(self.lens)
        return self.position + self.rotation[:, :2] @ offset

    @property
    def shear(self) -> NDArray[np.float64]:
        """How far the ray through the middle of the frame goes right and up, a metre in front of the eye."""
        blur = -np.divide(self.lens, self.focal_distance)
        return blur if self.orthographic else blur + self.centre

    @property
    def focus(self) -> NDArray[np.float64]:
        """Point that the camera is about [m], shape [3]."""
        return self.position - self.distance * self.rotation[:, 2]

    @property
    def clip_planes(self) -> tuple[float, float]:
        """Distances of the near and the far plane [m]."""
        return self.clip or (_NEAR * self.distance, _FAR * self.distance)

    def planes_about(self, balls: NDArray[np.float64]) -> tuple[float, float]:
        """The clip planes, the near one moved on to the first of some balls [m].

        Depths are the more precise the farther away it is, and MuJoCo's is very near by default.
        """
        near, far = self.clip_planes
        if self.clip is None or not len(balls):
            return near, far
        depth = (self.eye - balls[:, :3]) @ self.rotation[:, 2]
        in_front = depth + balls[:, 3] > 0
        first = float((depth - balls[:, 3])[in_front].min(initial=far))
        return float(np.clip(_SLACK * first, near, max(near, far / 2))), far

    @property
    def half_height(self) -> float:
        """Half the height of what is seen: a metre in front of the eye, or with parallel rays anywhere [m]."""
        return self.fovy / 2 if self.orthographic else float(np.tan(np.radians(self.fovy) / 2))

    def half_sizes(self, aspect: float) -> NDArray[np.float64]:
        """Half the width and height of what is seen, likewise [m]; `aspect` is the frame's width over its height."""
        half_width = aspect * self.half_height if self.half_width is None else self.half_width
        return np.array([half_width, self.half_height])

    def is_plain(self, aspect: float) -> bool:
        """Whether it is in perspective, looks along the middle of its frame, and has square pixels."""
        centred = np.allclose(self.centre, 0.0, atol=_ROUND_OFF * self.half_height)
        return not self.orthographic and centred and self.has_square_pixels(aspect)

    def has_square_pixels(self, aspect: float) -> bool:
        """Whether pixels of a frame of an aspect, width over height, are as wide as high."""
        return bool(
            np.isclose(self.half_sizes(aspect)[0], aspect * self.half_height, rtol=_ROUND_OFF)
        )

    def in_perspective(self, aspect: float, shown_by: str) -> Pose:
        """For what can show no other: itself in plain perspective, where what is in focus has the same height.

        It warns once that `shown_by` shows it otherwise than it is.
        """
        if self.is_plain(aspect):
            return self
        warn_caller(
            f"{shown_by} shows the camera in perspective, centred and with square pixels, which it "
            f"is not; "
            "RippleRenderer and ripple-sim render show it as it is"
        )
        half_height = self.half_height / self.distance if self.orthographic else self.half_height
        fovy = float(np.degrees(2 * np.arctan(half_height)))
        return dataclasses.replace(
            self, fovy=fovy, orthographic=False, centre=(0.0, 0.0), half_width=None
        )

    def pose(self) -> Pose:
        """Itself: a pose is a viewpoint."""
        return self

    def projection(
        self, aspect: float, planes: tuple[float, float] | None = None
    ) -> NDArray[np.float64]:
        """Eye to clip coordinates, shape [4, 4]; see `view_matrix`.

        The `planes` are the clip planes by default.
        """
        near, far = planes or self.clip_planes
        if not self.orthographic and self.half_width is None:
            return perspective(self.fovy, aspect, near, far, self.shear)
        scale = 1 / self.half_sizes(aspect)
        projection = np.zeros((4, 4))
        projection[[0, 1], [0, 1]] = scale
        projection[:2, 2] = scale * self.shear
        projection[2:, 2:] = (
            _parallel_depth(near, far) if self.orthographic else _perspective_depth(near, far)
        )
        return projection

    def local(self, points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Points [..., 3] of the world as the eye has them: to the right and up [..., 2], and distances [...] [m].

        The former are off the ray through the middle of the frame, the latter along the camera's
        axis.
        """
        local = (points - self.eye) @ self.rotation
        depth = -local[..., 2]
        return local[..., :2] - depth[..., None] * self.shear, depth

    def ways(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """From where the rays to points of the world start to the points, both [..., 3] [m]."""
        if not self.orthographic:
            return points - self.eye
        _, depth = self.local(points)
        return depth[..., None] * (self.rotation @ [*self.shear, -1.0])

    def pixels(
        self, points: NDArray[np.float64], size: tuple[int, int]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where points of the world are in a frame of a size (width, height).

        Returns
        -------
        array, shape [..., 2]
            Columns and rows, from the frame's upper left corner [pixels]; nonsense behind a camera
            in perspective.
        array, shape [...]
            Distances along the camera's axis [m].
        """
        beside, depth = self.local(points)
        if not self.orthographic:
            beside = beside / np.maximum(depth, 1e-12)[..., None]
        scale = np.array(size) / (2 * self.half_sizes(size[0] / size[1]))
        return np.array(size) / 2 + scale * beside * [1, -1], depth

    def points(self, depth: NDArray[np.floating]) -> NDArray[np.float64]:
        """Points of the world [height, width, 3] that the pixels of a frame show at distances along the axis [m]."""
        height, width = depth.shape
        half_width, half_height = self.half_sizes(width / height)
        right = half_width * (2 * (np.arange(width) + 0.5) - width) / width
        up = half_height * (1 - 2 * (np.arange(height) + 0.5) / height)
        offset = np.stack([*np.meshgrid(right, up), np.zeros((height, width))], axis=-1)
        along = np.array([*self.shear, -1.0])
        depth = depth[..., None].astype(np.float64)
        local = offset + depth * along if self.orthographic else depth * (offset + along)
        return self.eye + local @ self.rotation.T

    def pixel_height(self, depth: float, height: int) -> float:
        """Height of a pixel of a frame [m] at a distance along the axis [m]; `height` is the frame's [pixels]."""
        return 2 * self.half_height * (1.0 if self.orthographic else depth) / height


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
            values = np.array(
                [*self.lookat, self.distance, self.azimuth, self.elevation, self.fovy]
            )
        except (TypeError, ValueError):  # no sequence, or sequences in place of numbers
            values = np.array(None)
        valid = values.shape == (7,) and values.dtype.kind in "iuf" and np.isfinite(values).all()
        if not (valid and self.distance > 0 and 0 < self.fovy < 180):
            raise RippleError(
                f"camera {shown(self)} is invalid: lookat must be three numbers, every number "
                f"finite, the distance "
                "positive [m], and fovy between 0 and 180 degrees"
            )

    def pose(self) -> Pose:
        """Return position and axes in the world."""
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
        return Pose(
            np.asarray(self.lookat) - self.distance * forward, rotation, self.distance, self.fovy
        )

    @staticmethod
    def from_mjcf(model: Any, data: Any, name: str | int) -> FixedCamera:
        """Return a camera of a MuJoCo model, by its name or its id, as posed in `data`.

        Raises
        ------
        SceneError
            If the model has no such camera.
        """
        index = _camera_id(model, name)
        camera = mujoco.MjvCamera()
        camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        camera.fixedcamid = index
        data = with_camera_poses(model, data)
        pose = _as_in_mujoco(model, data, camera, _focus_distance(model, data, index))
        # the scene's camera has single precision
        fovy = pose.fovy if model.cam_sensorsize[index].any() else float(model.cam_fovy[index])
        rotation = np.array(data.cam_xmat[index]).reshape(3, 3)
        return dataclasses.replace(
            pose, position=np.array(data.cam_xpos[index]), rotation=rotation, fovy=fovy
        )


# A camera with a given pose, such as one that a MuJoCo model fixes to a body.
FixedCamera: TypeAlias = Pose

# Both have a `pose()`; where the renderer takes a viewpoint, anything that has one will do.
Viewpoint: TypeAlias = Camera | Pose


def find_viewpoint(model: mujoco.MjModel, data: mujoco.MjData, camera: Any) -> Viewpoint:
    """The viewpoint of whatever stands for a camera, as posed in `data`.

    Cameras of MuJoCo's see what they see in MuJoCo: orthographic ones, those with intrinsics, and
    clip planes too.

    Parameters
    ----------
    camera : Viewpoint, str, int or mujoco.MjvCamera
        A viewpoint itself; the name or the id of a camera in the MJCF; -1 for MuJoCo's free camera,
        aimed at the model's middle; or a camera of MuJoCo's that is free, tracks a body or is
        fixed.

    Raises
    ------
    SceneError
        If it is anything else, or names what the model does not have.
    """
    if callable(getattr(camera, "pose", None)):
        return camera
    camera = mujoco_camera(model, camera)
    if camera.type == mujoco.mjtCamera.mjCAMERA_FIXED:
        return Camera.from_mjcf(model, data, camera.fixedcamid)
    if camera.type == mujoco.mjtCamera.mjCAMERA_TRACKING:
        data = with_camera_poses(model, data)
    return _as_in_mujoco(
        model, data, camera, max(camera.distance, _LEAST_FOCUS * model.stat.extent)
    )


def mujoco_camera(model: mujoco.MjModel, camera: Any) -> mujoco.MjvCamera:
    """What stands for a camera of MuJoCo's, see `find_viewpoint`, as an `MjvCamera` that fits the model.

    Raises
    ------
    SceneError
        If it is anything else, or names what the model does not have.
    """
    kinds = mujoco.mjtCamera
    if isinstance(camera, numbers.Integral | str):
        found = mujoco.MjvCamera()
        if isinstance(camera, numbers.Integral) and camera == -1:
            mujoco.mjv_defaultFreeCamera(model, found)
        else:
            found.type = kinds.mjCAMERA_FIXED
            found.fixedcamid = _camera_id(model, camera)
        return found
    if not isinstance(camera, mujoco.MjvCamera):
        raise SceneError(
            f"camera is {type(camera).__name__}; valid are a Camera, a FixedCamera, the name or "
            f"the id of a camera in "
            "the model, -1 for the free camera, and a mujoco.MjvCamera"
        )
    if camera.type == kinds.mjCAMERA_FIXED:
        _camera_id(model, camera.fixedcamid)
    elif camera.type == kinds.mjCAMERA_TRACKING:
        if not 0 <= camera.trackbodyid < model.nbody:
            raise SceneError(
                f"the MjvCamera's trackbodyid is {camera.trackbodyid}; valid are 0 to "
                f"{model.nbody - 1}, the model's "
                "bodies"
            )
    elif camera.type != kinds.mjCAMERA_FREE:
        raise SceneError(
            f"the MjvCamera's type is {camera.type}; valid are mjCAMERA_FREE "
            f"({int(kinds.mjCAMERA_FREE)}), "
            f"mjCAMERA_TRACKING ({int(kinds.mjCAMERA_TRACKING)}) and mjCAMERA_FIXED "
            f"({int(kinds.mjCAMERA_FIXED)})"
        )
    return camera


def _camera_id(model: mujoco.MjModel, name: Any) -> int:
    """Id of a camera of the MJCF, given by its name or its id; raises `SceneError`, as `mujoco.Renderer` words it."""
    named = isinstance(name, str)
    index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, name) if named else int(name)
    if not 0 <= index < model.ncam:
        wrong = (
            f'"{name}" does not exist'
            if named
            else f"id {index} is out of range [-1, {model.ncam})"
        )
        names = ", ".join(f"{model.camera(i).name!r} (id {i})" for i in range(model.ncam)) or "none"
        shown_name = repr(name) if named else index
        raise SceneError(
            f"The camera {wrong}. The model has no camera {shown_name}; it has: {names}"
        )
    return index


def _as_in_mujoco(
    model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera, distance: float
) -> Pose:
    """What a camera of MuJoCo's sees in MuJoCo."""
    scene = mujoco.MjvScene()
    mujoco.mjv_updateCamera(model, data, camera, scene)
    return pose_of_scene(scene.camera, distance)


def pose_of_scene(cameras: Sequence[mujoco.MjvGLCamera], distance: float) -> Pose:
    """The camera of a scene of MuJoCo's, `mujoco.MjvScene.camera`, as `mjr_render` sees with it.

    Parameters
    ----------
    cameras : sequence of mujoco.MjvGLCamera
        Of the left and the right eye, whose mean it is.
    distance : float
        Of the focus, which a scene does not know [m].

    Raises
    ------
    SceneError
        If they see nothing: they were never updated, or their frustum is empty.
    """
    left, right = cameras
    if left.orthographic != right.orthographic:
        raise SceneError(
            "of the scene's two cameras one is orthographic; set `orthographic` of both alike"
        )
    camera = mujoco.mjv_averageCamera(left, right)
    near = float(camera.frustum_near)
    far = float(camera.frustum_far)
    low = float(camera.frustum_bottom)
    high = float(camera.frustum_top)
    if not (0 < near < far and low < high):
        raise SceneError(
            f"the scene's camera sees nothing: its frustum is {low:g} m to {high:g} m high, from "
            f"{near:g} m to {far:g} "
            "m away; call mjv_updateScene or mjv_updateCamera, or set its frustum so that near is "
            "positive and less "
            "than far, and bottom less than top"
        )
    forward = np.array(camera.forward, dtype=np.float64)
    forward /= np.linalg.norm(forward)
    across = np.cross(forward, np.array(camera.up, dtype=np.float64))
    across /= np.linalg.norm(across)
    # in perspective the frustum is that of the near plane
    scale = 1.0 if camera.orthographic else 1 / near
    half_height = scale * (high - low) / 2
    return Pose(
        np.array(camera.pos, dtype=np.float64),
        np.stack([across, np.cross(across, forward), -forward], axis=1),
        distance,
        fovy=2 * half_height
        if camera.orthographic
        else float(np.degrees(2 * np.arctan(half_height))),
        orthographic=bool(camera.orthographic),
        centre=(scale * float(camera.frustum_center), scale * (low + high) / 2),
        half_width=scale * float(camera.frustum_width) or None,
        clip=(near, far),
    )


def set_scene_camera(
    cameras: Sequence[mujoco.MjvGLCamera], pose: Pose, model: mujoco.MjModel
) -> None:
    """Let both cameras of a scene of MuJoCo's see what a pose sees, through the middle of its lens.

    Where the pose says nothing of clip planes they are the model's, but the near one no farther
    than the pose needs.
    """
    extent = model.stat.extent
    near, far = pose.clip or (
        min(model.vis.map.znear * extent, pose.clip_planes[0]),
        max(model.vis.map.zfar * extent, 2 * pose.distance),
    )
    scale = 1.0 if pose.orthographic else near
    for camera in cameras:
        camera.pos = pose.position
        camera.forward = -pose.rotation[:, 2]
        camera.up = pose.rotation[:, 1]
        camera.orthographic = int(pose.orthographic)
        camera.frustum_center = scale * pose.centre[0]
        camera.frustum_width = 0.0 if pose.half_width is None else scale * pose.half_width
        camera.frustum_bottom = scale * (pose.centre[1] - pose.half_height)
        camera.frustum_top = scale * (pose.centre[1] + pose.half_height)
        camera.frustum_near = near
        camera.frustum_far = far


def with_camera_poses(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData:
    """The data, or where no poses of cameras were ever computed a copy that has them and those of the lights.

    `mj_kinematics` alone leaves them at zero; it warns of that.
    """
    if not model.ncam or np.asarray(data.cam_xmat).any():
        return data
    warn_caller(
        "the data has no poses of cameras, which mj_kinematics alone does not compute: they are "
        "computed for this "
        "picture; call mj_forward, or mj_comPos and mj_camlight after mj_kinematics"
    )
    data = copy.copy(data)
    for compute in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight):
        compute(model, data)
    return data


def _focus_distance(model: mujoco.MjModel, data: mujoco.MjData, camera: int) -> float:
    """How far from a camera of the MJCF what it is about lies [m].

    That is the body that it turns to; or, where a body carries it, the middle of all that moves
    along; or else the model's middle.
    """
    position = data.cam_xpos[camera]
    target = int(model.cam_targetbodyid[camera])
    carrier = int(model.cam_bodyid[camera])
    extent = float(model.stat.extent)
    if model.cam_mode[camera] in (_AT_BODY, _AT_MASS) and target >= 0:
        aim = data.xpos[target] if model.cam_mode[camera] == _AT_BODY else data.subtree_com[target]
        return max(float(np.linalg.norm(position - aim)), _LEAST_FOCUS * extent)
    if model.body_weldid[carrier]:  # which is 0 where it is fixed to the world
        away = float(np.linalg.norm(position - data.subtree_com[model.body_rootid[carrier]]))
        return max(away, _LEAST_FOCUS_RIDING * extent)
    return max(float(np.linalg.norm(position - model.stat.center)), _LEAST_FOCUS * extent)


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

    `fovy` in degrees; `aspect` is width over height; `near` and `far` in metres; for `shear` see
    `Pose`.
    """
    scale = 1.0 / np.tan(np.radians(fovy) / 2)
    projection = np.zeros((4, 4))
    projection[0, 0] = scale / aspect
    projection[1, 1] = scale
    projection[:2, 2] = np.multiply([scale / aspect, scale], shear)
    projection[2:, 2:] = _perspective_depth(near, far)
    return projection


def _perspective_depth(near: float, far: float) -> NDArray[np.float64]:
    """What a perspective camera makes of the last two coordinates, shape [2, 2]."""
    return np.array([[(near + far) / (near - far), 2 * near * far / (near - far)], [-1.0, 0.0]])


def _parallel_depth(near: float, far: float) -> NDArray[np.float64]:
    """What an orthographic camera makes of the last two coordinates, shape [2, 2]."""
    return np.array([[2 / (near - far), (near + far) / (near - far)], [0.0, 1.0]])


def orthographic(half_width: float, depth: float) -> NDArray[np.float64]:
    """Eye to clip coordinates of a square box from 0 to `depth` [m] in front of the eye, shape [4, 4]."""
    matrix = np.diag([1 / half_width, 1 / half_width, -2 / depth, 1.0])
    matrix[2, 3] = -1.0
    return matrix


def within(
    balls: NDArray[np.float64], point: NDArray[np.float64], reach: float
) -> NDArray[np.float64]:
    """The balls that any point within `reach` [m] of a point [3] touches."""
    return balls[np.linalg.norm(balls[:, :3] - point, axis=1) - balls[:, 3] < reach]


def enclosing(balls: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Centre [3] and radius of a ball that contains others."""
    centres = balls[:, :3]
    radii = balls[:, 3]
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
    radii = [
        np.linalg.norm(each - centre, axis=1).max()
        for each, centre in zip(corners, centres, strict=True)
    ]
    return np.column_stack([centres, radii])


def boxes_of(balls: NDArray[np.float64], pose: Pose, size: tuple[int, int]) -> NDArray[np.int64]:
    """Boxes about balls in a frame of a size (width, height) [pixels].

    Returns
    -------
    int64 [k, 4]
        Left, lower, right and upper edge [pixels], counted from the lower left. Balls behind the
        camera have a box of size 0.
    """
    centres = balls[:, :3]
    radii = balls[:, 3]
    local = (centres - pose.eye) @ pose.rotation
    beside = local[:, :2]
    middle = -local[:, 2]
    near = middle - radii
    far = middle + radii
    seen = np.isfinite(radii) if pose.orthographic else near > _CLOSEST * radii
    scale = np.array(size) / (2 * pose.half_sizes(size[0] / size[1]))
    # in perspective the nearest point of the ball's box is seen under the widest angle
    corners = np.stack(
        [
            _on_screen(beside[seen] + side * radii[seen, None], depth[seen, None], pose)
            for side in (-1, 1)
            for depth in (near, far)
        ]
    )
    origin = np.array(size) / 2
    boxes = np.tile([0, 0, *size], (len(radii), 1))
    boxes[seen, :2] = np.clip(np.floor(origin + scale * corners.min(axis=0)), 0, size)
    boxes[seen, 2:] = np.clip(np.ceil(origin + scale * corners.max(axis=0)), 0, size)
    boxes[far <= 0] = 0
    return boxes


def _on_screen(
    beside: NDArray[np.float64], depth: NDArray[np.float64], pose: Pose
) -> NDArray[np.float64]:
    """Where points beside the eye [k, 2], at depths [k, 1] [m], are off the middle of the frame; see `half_sizes`."""
    if pose.orthographic:
        return beside - depth * pose.shear
    return beside / depth - pose.shear


def scissor_of(boxes: NDArray[np.int64]) -> tuple[int, int, int, int] | None:
    """Smallest scissor (left, lower, width, height) about boxes [k, 4]; None if all are empty."""
    boxes = boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]
    if not len(boxes):
        return None
    left, lower = (int(edge) for edge in boxes[:, :2].min(axis=0))
    right, upper = (int(edge) for edge in boxes[:, 2:].max(axis=0))
    return left, lower, right - left, upper - lower
