"""MuJoCo's cameras: what they see as a pose, and poses as cameras of a scene."""

from __future__ import annotations

import copy
import dataclasses
import numbers
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import warn_caller

from .pose import Pose

# Least distance of the focus [extents of the model]. A camera inside the model is closer to the
# model's middle than to the things that it shows.
MIN_FOCUS_DISTANCE = 0.05

# Least distance of the focus of a camera that a body carries [extents of the model]: such a camera
# shows the body's surroundings.
_MIN_FOCUS_DISTANCE_ON_BODY = 0.5

# Modes of cameras that turn to a body, and to the centre of mass of its subtree.
_TARGET_BODY = int(mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY)
_TARGET_CENTRE_OF_MASS = int(mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODYCOM)


def mujoco_camera(model: mujoco.MjModel, camera: Any) -> mujoco.MjvCamera:
    """Return an `MjvCamera` that fits the model, for one of MuJoCo's cameras.

    The camera is given by name, id or as an `MjvCamera`, see `find_viewpoint`.

    Raises
    ------
    SceneError
        If `camera` is anything else, or names a camera or body that the model does not have.
    """
    if isinstance(camera, numbers.Integral | str):
        return _mujoco_camera_by_name(model, camera)
    if not isinstance(camera, mujoco.MjvCamera):
        raise SceneError(
            "camera must be a Camera, a FixedCamera, the name or the id of a camera in the "
            f"model, -1 for the free camera, or a mujoco.MjvCamera, got {type(camera).__name__}"
        )
    _check_mujoco_camera(model, camera)
    return camera


def _mujoco_camera_by_name(model: mujoco.MjModel, name: Any) -> mujoco.MjvCamera:
    """Return an `MjvCamera` for a camera of the MJCF, by its name or id; -1 is the free camera."""
    camera = mujoco.MjvCamera()
    if isinstance(name, numbers.Integral) and name == -1:
        mujoco.mjv_defaultFreeCamera(model, camera)
    else:
        camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        camera.fixedcamid = mjcf_camera_id(model, name)
    return camera


def _check_mujoco_camera(model: mujoco.MjModel, camera: mujoco.MjvCamera) -> None:
    """Raise `SceneError` unless the type of an `MjvCamera` is known and its id is in the model."""
    kinds = mujoco.mjtCamera
    if camera.type == kinds.mjCAMERA_FIXED:
        mjcf_camera_id(model, camera.fixedcamid)
    elif camera.type == kinds.mjCAMERA_TRACKING:
        if not 0 <= camera.trackbodyid < model.nbody:
            raise SceneError(
                "the MjvCamera's trackbodyid must be a body of the model, 0 to "
                f"{model.nbody - 1}, got {camera.trackbodyid}"
            )
    elif camera.type != kinds.mjCAMERA_FREE:
        raise SceneError(
            f"the MjvCamera's type must be mjCAMERA_FREE ({int(kinds.mjCAMERA_FREE)}), "
            f"mjCAMERA_TRACKING ({int(kinds.mjCAMERA_TRACKING)}) or mjCAMERA_FIXED "
            f"({int(kinds.mjCAMERA_FIXED)}), got {camera.type}"
        )


def mjcf_camera_id(model: mujoco.MjModel, name: Any) -> int:
    """Id of a camera of the MJCF, by its name or its id.

    Raises
    ------
    SceneError
        If the model has no such camera. The message begins with the words of `mujoco.Renderer`.
    """
    is_name = isinstance(name, str)
    kind = mujoco.mjtObj.mjOBJ_CAMERA
    camera_id = mujoco.mj_name2id(model, kind, name) if is_name else int(name)
    if 0 <= camera_id < model.ncam:
        return camera_id
    if is_name:
        mistake = f'"{name}" does not exist'
        shown_name = repr(name)
    else:
        mistake = f"id {camera_id} is out of range [-1, {model.ncam})"
        shown_name = str(camera_id)
    cameras = [f"{model.camera(i).name!r} (id {i})" for i in range(model.ncam)]
    raise SceneError(
        f"The camera {mistake}. The model has no camera {shown_name}; "
        f"it has: {', '.join(cameras) or 'none'}"
    )


def pose_of_mjcf_camera(model: mujoco.MjModel, data: mujoco.MjData, name: str | int) -> Pose:
    """Pose of a camera of the MJCF, by its name or its id, as posed in `data`.

    Raises
    ------
    SceneError
        If the model has no such camera.
    """
    camera_id = mjcf_camera_id(model, name)
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
    camera.fixedcamid = camera_id
    data = with_camera_poses(model, data)
    pose = pose_in_mujoco(model, data, camera, _focus_distance(model, data, camera_id))
    # `mjv_updateCamera` writes in single precision; the model and the data have double precision
    fovy = float(model.cam_fovy[camera_id])
    if model.cam_sensorsize[camera_id].any():
        fovy = pose.fovy  # follows from the intrinsics
    position = np.array(data.cam_xpos[camera_id])
    rotation = np.array(data.cam_xmat[camera_id]).reshape(3, 3)
    return dataclasses.replace(pose, position=position, rotation=rotation, fovy=fovy)


def pose_in_mujoco(
    model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera, distance: float
) -> Pose:
    """Pose with the view of an `MjvCamera` in MuJoCo; `distance` is that of the focus [m]."""
    scene = mujoco.MjvScene()
    mujoco.mjv_updateCamera(model, data, camera, scene)
    return pose_of_scene(scene.camera, distance)


def pose_of_scene(cameras: Sequence[mujoco.MjvGLCamera], distance: float) -> Pose:
    """Pose with the view that `mjr_render` has of a scene, from `mujoco.MjvScene.camera`.

    Parameters
    ----------
    cameras : sequence of mujoco.MjvGLCamera
        The cameras of the left and the right eye; the view is that of their mean.
    distance : float
        Distance of the focus, which a scene does not contain [m].

    Raises
    ------
    SceneError
        If the cameras see nothing: they were never updated, or their frustum is empty.
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
            f"{near:g} m to {far:g} m away; call mjv_updateScene or mjv_updateCamera, or set its "
            "frustum so that near is positive and less than far, and bottom less than top"
        )
    forward = np.array(camera.forward, dtype=np.float64)
    forward /= np.linalg.norm(forward)
    across = np.cross(forward, np.array(camera.up, dtype=np.float64))
    across /= np.linalg.norm(across)
    # in perspective MuJoCo measures the frustum at the near plane, a pose one metre from the eye
    scale = 1.0 if camera.orthographic else 1 / near
    half_height = scale * (high - low) / 2
    fovy = float(np.degrees(2 * np.arctan(half_height)))
    if camera.orthographic:
        fovy = 2 * half_height  # [m]
    return Pose(
        position=np.array(camera.pos, dtype=np.float64),
        rotation=np.stack([across, np.cross(across, forward), -forward], axis=1),
        distance=distance,
        fovy=fovy,
        orthographic=bool(camera.orthographic),
        centre=(scale * float(camera.frustum_center), scale * (low + high) / 2),
        half_width=scale * float(camera.frustum_width) or None,
        clip=(near, far),
    )


def set_scene_camera(
    cameras: Sequence[mujoco.MjvGLCamera], pose: Pose, model: mujoco.MjModel
) -> None:
    """Give both cameras of a scene the view of a pose, through the middle of its lens.

    Without clip planes of the pose, the model's are taken. The near plane is then at most as far
    away as the pose's default, and the far plane lies at least twice as far as the focus.
    """
    extent = model.stat.extent
    if pose.clip:
        near, far = pose.clip
    else:
        near = min(model.vis.map.znear * extent, pose.clip_planes[0])
        far = max(model.vis.map.zfar * extent, 2 * pose.distance)
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
    """Return the data, or a copy with poses of cameras and lights if the data has none.

    `mj_kinematics` alone leaves the poses of cameras at zero. A warning says so.
    """
    if not model.ncam or np.asarray(data.cam_xmat).any():
        return data
    warn_caller(
        "the data has no poses of cameras, which mj_kinematics alone does not compute: they are "
        "computed for this picture; call mj_forward, or mj_comPos and mj_camlight after "
        "mj_kinematics"
    )
    data = copy.copy(data)
    for compute in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight):
        compute(model, data)
    return data


def _focus_distance(model: mujoco.MjModel, data: mujoco.MjData, camera: int) -> float:
    """Distance of the focus from a camera of the MJCF [m].

    The focus is the body that the camera turns to; or, for a camera that a moving body carries, the
    centre of mass of everything that moves along; or else the model's middle.
    """
    position = data.cam_xpos[camera]
    mode = model.cam_mode[camera]
    target = int(model.cam_targetbodyid[camera])
    carrier = int(model.cam_bodyid[camera])
    # `body_weldid` is 0 for bodies that are fixed to the world
    is_movable = bool(model.body_weldid[carrier])
    min_distance = MIN_FOCUS_DISTANCE
    if mode == _TARGET_BODY and target >= 0:
        focus = data.xpos[target]
    elif mode == _TARGET_CENTRE_OF_MASS and target >= 0:
        focus = data.subtree_com[target]
    elif is_movable:
        focus = data.subtree_com[model.body_rootid[carrier]]
        min_distance = _MIN_FOCUS_DISTANCE_ON_BODY
    else:
        focus = model.stat.center
    distance = float(np.linalg.norm(position - focus))
    return max(distance, min_distance * float(model.stat.extent))
