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


_AT_BODY = int(mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY)


_AT_MASS = int(mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODYCOM)


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
            found.fixedcamid = mjcf_camera_id(model, camera)
        return found
    if not isinstance(camera, mujoco.MjvCamera):
        raise SceneError(
            f"camera is {type(camera).__name__}; valid are a Camera, a FixedCamera, the name or "
            f"the id of a camera in "
            "the model, -1 for the free camera, and a mujoco.MjvCamera"
        )
    if camera.type == kinds.mjCAMERA_FIXED:
        mjcf_camera_id(model, camera.fixedcamid)
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


def mjcf_camera_id(model: mujoco.MjModel, name: Any) -> int:
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
        return max(float(np.linalg.norm(position - aim)), MIN_FOCUS_DISTANCE * extent)
    if model.body_weldid[carrier]:  # which is 0 where it is fixed to the world
        away = float(np.linalg.norm(position - data.subtree_com[model.body_rootid[carrier]]))
        return max(away, _MIN_FOCUS_DISTANCE_ON_BODY * extent)
    return max(float(np.linalg.norm(position - model.stat.center)), MIN_FOCUS_DISTANCE * extent)
