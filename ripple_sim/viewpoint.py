"""Where the camera of a scene stands at a given time."""

from __future__ import annotations

import mujoco
import numpy as np

from .render import Camera, FixedCamera
from .scene.scene_file import CameraEntry


def viewpoint(model: mujoco.MjModel, data: mujoco.MjData, entry: CameraEntry, time: float) -> Camera | FixedCamera:
    """Camera of a scene at a time [s].

    A camera named in the MJCF is taken as it stands in `data` (it may ride on a body). Otherwise MuJoCo's free camera,
    aimed at the model's middle where the scene says nothing else, going round by `orbit` degrees a second.
    """
    if entry.name is not None:
        fixed = Camera.from_mjcf(model, data, entry.name)
        return fixed if not entry.orbit else _turned(fixed, np.radians(entry.orbit) * time)
    x, y, z = entry.lookat if entry.lookat is not None else (float(value) for value in model.stat.center)
    return Camera(
        lookat=(x, y, z),
        distance=entry.distance if entry.distance is not None else 1.5 * float(model.stat.extent),
        azimuth=entry.azimuth + entry.orbit * time,
        elevation=entry.elevation,
        fovy=entry.fovy,
    )


def _turned(camera: FixedCamera, angle: float) -> FixedCamera:
    """The camera turned round the vertical through the point that it looks at [rad]."""
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    focus = camera.pose().focus
    return FixedCamera(focus + turn @ (camera.position - focus), turn @ camera.rotation, camera.distance, camera.fovy)
