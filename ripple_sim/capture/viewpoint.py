"""Viewpoint of a scene's camera at a given time, free or fixed, orbiting or tracking; and its focal distance."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render import Camera, FixedCamera
from ripple_sim.render.camera import Pose
from ripple_sim.scene.camera import CameraEntry

_NEAREST = 0.02  # least focal distance, in camera distances: the near plane


def viewpoint(model: mujoco.MjModel, data: mujoco.MjData, entry: CameraEntry, time: float) -> Camera | FixedCamera:
    """Camera of a scene at a time [s].

    A camera named in the MJCF is taken as it stands in `data` (it may ride on a body). Otherwise MuJoCo's free camera,
    aimed at the model's middle where the scene says nothing else. With `orbit` either circles by that many degrees a
    second; with `track` the free camera moves along with a body's centre of mass, and the named one turns towards it.
    """
    tracked = None if entry.track is None else data.subtree_com[model.body(entry.track).id]
    if entry.name is not None:
        fixed = Camera.from_mjcf(model, data, entry.name)
        if tracked is not None:
            fixed = _aimed(fixed, tracked)
        return fixed if not entry.orbit else _turned(fixed, np.radians(entry.orbit) * time)
    base = np.zeros(3) if tracked is not None else model.stat.center
    aim = base if entry.lookat is None else entry.lookat
    x, y, z = (float(value) for value in (aim if tracked is None else tracked + aim))
    return Camera(
        lookat=(x, y, z),
        distance=entry.distance if entry.distance is not None else 1.5 * float(model.stat.extent),
        azimuth=entry.azimuth + entry.orbit * time,
        elevation=entry.elevation,
        fovy=entry.fovy,
    )


def focal_distance(model: mujoco.MjModel, data: mujoco.MjData, entry: CameraEntry, pose: Pose) -> float:
    """Distance of the plane in focus from a scene's camera, along its axis [m]."""
    if entry.focus is None:
        return pose.distance
    if isinstance(entry.focus, float):
        return entry.focus
    if isinstance(entry.focus, str):
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, entry.focus)
        point = data.subtree_com[body] if body >= 0 else data.geom_xpos[model.geom(entry.focus).id]
    else:
        point = np.array(entry.focus)
    return max(float((pose.position - point) @ pose.rotation[:, 2]), _NEAREST * pose.distance)


def _aimed(camera: FixedCamera, target: NDArray[np.float64]) -> FixedCamera:
    """The camera turned in place, upright, towards a point [m]."""
    back = camera.position - target
    distance = float(np.linalg.norm(back))
    right = np.cross([0.0, 0.0, 1.0], back)
    if distance == 0 or not right.any():  # at the point itself, or exactly above or below it
        return camera
    right /= np.linalg.norm(right)
    back = back / distance
    return FixedCamera(camera.position, np.stack([right, np.cross(back, right), back], axis=1), distance, camera.fovy)


def _turned(camera: FixedCamera, angle: float) -> FixedCamera:
    """The camera turned by an angle [rad] around the vertical through its aim."""
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    focus = camera.pose().focus
    return FixedCamera(focus + turn @ (camera.position - focus), turn @ camera.rotation, camera.distance, camera.fovy)
