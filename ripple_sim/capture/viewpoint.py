"""Where the camera of a scene stands at a given time, free or fixed, orbiting or tracking; and what it focuses on."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.render import Camera, FixedCamera
from ripple_sim.render.camera import Pose
from ripple_sim.scene.scene_file import CameraEntry

if TYPE_CHECKING:
    from ripple_sim.scene.scene import Scene

MAX_EXPOSURES = 1024
_NEAREST = 0.02  # focal distance, in camera distances: there the picture begins


def check_camera(model: mujoco.MjModel, entry: CameraEntry) -> None:
    """Make sure that the model has what the camera names, and that a frame can be exposed as it says.

    Raises
    ------
    SceneError
    """
    for name, kind, count, missing in (
        (entry.name, mujoco.mjtObj.mjOBJ_CAMERA, model.ncam, "camera {!r}; its cameras are"),
        (entry.track, mujoco.mjtObj.mjOBJ_BODY, model.nbody, "body {!r} for the camera to track; its bodies are"),
    ):
        if name is not None and mujoco.mj_name2id(model, kind, name) < 0:
            raise SceneError(f"the model has no {missing.format(name)} {_names(model, kind, count)}")
    body, geom = mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_GEOM
    if isinstance(entry.focus, str) and all(mujoco.mj_name2id(model, kind, entry.focus) < 0 for kind in (body, geom)):
        raise SceneError(
            f"the model has nothing {entry.focus!r} for the camera to focus on; its bodies are "
            f"{_names(model, body, model.nbody)}; its geoms are {_names(model, geom, model.ngeom)}"
        )
    for name, value, valid, right in (
        ("shutter angle", entry.shutter, "0 to 360 degrees", 0 <= entry.shutter <= 360),
        ("aperture", entry.aperture, "0 m or more", 0 <= entry.aperture < np.inf),
        ("focus", entry.focus, "more than 0 m", not isinstance(entry.focus, float) or 0 < entry.focus < np.inf),
        ("number of exposures", entry.exposures, f"1 to {MAX_EXPOSURES}", 1 <= entry.exposures <= MAX_EXPOSURES),
    ):
        if not right:
            raise SceneError(f"the camera's {name} is {value!r}; valid is {valid}")


def _names(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> str:
    return ", ".join(name for i in range(count) if (name := mujoco.mj_id2name(model, kind, i))) or "none"


def through_camera(scene: Scene, name: str) -> Scene:
    """The scene seen through a camera of its model.

    Raises
    ------
    SceneError
        If the model has no such camera.
    """
    camera = CameraEntry(name=name)
    check_camera(scene.model, camera)
    return dataclasses.replace(scene, camera=camera)


def with_exposure(scene: Scene, **changes: Any) -> Scene:
    """The scene with other values of its camera's shutter, aperture, focus and exposures; None leaves one as it is.

    Raises
    ------
    SceneError
        If one is invalid, or would do nothing.
    """
    given = {name: value for name, value in changes.items() if value is not None}
    try:
        camera = msgspec.convert({**msgspec.structs.asdict(scene.camera), **given}, CameraEntry)
    except msgspec.ValidationError as error:
        raise SceneError(f"camera: {str(error).replace('`$.', '`')}") from error
    check_camera(scene.model, camera)
    if "focus" in given and not camera.aperture:
        raise SceneError("a focus needs a lens: give the camera an aperture of more than 0 m, such as 0.05")
    if given.get("exposures", 1) > 1 and not (camera.shutter or camera.aperture):
        raise SceneError(
            f"all {camera.exposures} exposures would be the same: give the camera a shutter angle, such as 180 degrees,"
            " an aperture, such as 0.05 m, or both"
        )
    return dataclasses.replace(scene, camera=camera)


def viewpoint(model: mujoco.MjModel, data: mujoco.MjData, entry: CameraEntry, time: float) -> Camera | FixedCamera:
    """Camera of a scene at a time [s].

    A camera named in the MJCF is taken as it stands in `data` (it may ride on a body). Otherwise MuJoCo's free camera,
    aimed at the model's middle where the scene says nothing else. With `orbit` either goes round by so many degrees a
    second; with `track` the free camera moves along with a body's centre of mass, and the named one turns to it.
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
    """How far in front of a camera of a scene lies the plane of what is sharp, along its axis [m]."""
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
    """The camera turned, upright, to a point [m] from where it stands."""
    back = camera.position - target
    distance = float(np.linalg.norm(back))
    right = np.cross([0.0, 0.0, 1.0], back)
    if distance == 0 or not right.any():  # it stands in the point, or straight above or below
        return camera
    right /= np.linalg.norm(right)
    back = back / distance
    return FixedCamera(camera.position, np.stack([right, np.cross(back, right), back], axis=1), distance, camera.fovy)


def _turned(camera: FixedCamera, angle: float) -> FixedCamera:
    """The camera turned round the vertical through the point that it looks at [rad]."""
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    focus = camera.pose().focus
    return FixedCamera(focus + turn @ (camera.position - focus), turn @ camera.rotation, camera.distance, camera.fovy)
