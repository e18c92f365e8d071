"""`viewpoint`: where the camera of a scene stands; `focal_distance`: which distance is sharp."""

from __future__ import annotations

import dataclasses
from typing import Any

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render import Camera, FixedCamera
from ripple_sim.render.pose import Pose
from ripple_sim.scene.camera_entry import PATH_FIELDS, CameraEntry

# Least distance of the plane in focus, over the camera's distance from what it looks at: there the
# near plane is.
_MIN_FOCAL_DISTANCE = 0.02

# Distance of the free camera from what it looks at, in extents of the model.
_DEFAULT_DISTANCE = 1.5


def viewpoint(
    model: mujoco.MjModel, data: mujoco.MjData, entry: CameraEntry, time: float
) -> Camera | FixedCamera:
    """Camera of a scene at a time [s].

    A camera named in the MJCF is taken as it stands in `data`; it may ride on a body. Without a
    name it is MuJoCo's free camera, which looks at the model's middle if the scene has no `lookat`.
    With `orbit` either camera circles by that many degrees a second. With `track` the free camera
    moves along with a body's centre of mass, and `lookat` counts from there; the named camera turns
    towards it. The keys of a path move the free camera.
    """
    entry = on_path(entry, time)
    tracked = None if entry.track is None else data.subtree_com[model.body(entry.track).id]
    if entry.name is not None:
        fixed = Camera.from_mjcf(model, data, entry.name)
        if tracked is not None:
            fixed = _aimed(fixed, tracked)
        if entry.orbit:
            fixed = _orbited(fixed, np.radians(entry.orbit) * time)
        return fixed
    if tracked is not None:
        aim = tracked if entry.lookat is None else tracked + entry.lookat
    else:
        aim = model.stat.center if entry.lookat is None else entry.lookat
    x, y, z = (float(value) for value in aim)
    distance = entry.distance
    if distance is None:
        distance = _DEFAULT_DISTANCE * float(model.stat.extent)
    return Camera(
        lookat=(x, y, z),
        distance=distance,
        azimuth=entry.azimuth + entry.orbit * time,
        elevation=entry.elevation,
        fovy=entry.fovy,
    )


def on_path(entry: CameraEntry, time: float) -> CameraEntry:
    """The camera with the values that its keys give at a time [s].

    Between keys a value follows the monotone cubic of Fritsch and Carlson ("Monotone piecewise
    cubic interpolation", SIAM Journal on Numerical Analysis 17, 1980): it passes through every key
    and overshoots none. It starts and ends at rest.
    """
    values: dict[str, Any] = {}
    for name in PATH_FIELDS:
        keys = [key for key in entry.key if getattr(key, name) is not None]
        if keys:
            times = np.array([key.time for key in keys])
            value = _on_curve(times, np.array([getattr(key, name) for key in keys], float), time)
            values[name] = tuple(value.tolist()) if value.ndim else float(value)
    return msgspec.structs.replace(entry, **values)


def _on_curve(
    times: NDArray[np.float64], values: NDArray[np.float64], time: float
) -> NDArray[np.float64]:
    """A smooth curve through values [k] or [k, 3] at times [k], constant before and after."""
    from scipy.interpolate import PchipInterpolator  # most cameras do without, and it loads slowly

    # with equal values beyond both ends the curve is level there
    all_times = np.array([times[0] - 1.0, *times, times[-1] + 1.0])
    all_values = np.array([values[0], *values, values[-1]])
    curve = PchipInterpolator(all_times, all_values)
    return np.asarray(curve(np.clip(time, times[0], times[-1])))


def focal_distance(
    model: mujoco.MjModel, data: mujoco.MjData, entry: CameraEntry, pose: Pose
) -> float:
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
    backwards = pose.rotation[:, 2]
    distance = float((pose.position - point) @ backwards)
    return max(distance, _MIN_FOCAL_DISTANCE * pose.distance)


def _orbited(camera: FixedCamera, angle: float) -> FixedCamera:
    """The camera turned by an angle [radians] about the vertical through the point it looks at."""
    turn = np.array(
        [
            [np.cos(angle), -np.sin(angle), 0.0],
            [np.sin(angle), np.cos(angle), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    focus = camera.pose().focus
    position = focus + turn @ (camera.position - focus)
    return dataclasses.replace(camera, position=position, rotation=turn @ camera.rotation)


def _aimed(camera: FixedCamera, target: NDArray[np.float64]) -> FixedCamera:
    """The camera turned in place, upright, towards a point [m]."""
    back = camera.position - target
    distance = float(np.linalg.norm(back))
    right = np.cross([0.0, 0.0, 1.0], back)
    if distance == 0 or not right.any():  # at the point itself, or exactly above or below it
        return camera
    right /= np.linalg.norm(right)
    back = back / distance
    rotation = np.stack([right, np.cross(back, right), back], axis=1)
    return dataclasses.replace(camera, rotation=rotation, distance=distance)
