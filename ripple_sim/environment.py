"""What a MuJoCo environment of Gymnasium has: its model and data, the size of its frames, and its camera."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from ripple_sim.coupling.arguments import own_data, own_model
from ripple_sim.errors import SceneError
from ripple_sim.render import Camera, FixedCamera

# Of MuJoCo's cameras, and of frames where an environment does not say.
_AZIMUTH, _ELEVATION, _SIZE = 90.0, -45.0, 480


def model_and_data(env: Any) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Model and data of an unwrapped environment: its own, or those of its dm_control `physics`.

    Raises
    ------
    SceneError
        If it has none.
    """
    holder = getattr(env, "physics", env)
    if not (hasattr(holder, "model") and hasattr(holder, "data")):
        raise SceneError(
            f"the environment {env} has no `model` and `data`; valid are MuJoCo environments, such as those derived "
            "from gymnasium.envs.mujoco.MujocoEnv"
        )
    model = own_model(holder.model)
    return model, own_data(model, holder.data)


def frame_size(env: Any) -> tuple[int, int]:
    """Width and height of an environment's frames [pixels]."""
    viewer = getattr(env, "mujoco_renderer", env)
    return getattr(viewer, "width", None) or _SIZE, getattr(viewer, "height", None) or _SIZE


class EnvironmentCamera:
    """The camera with which a `MujocoEnv` renders offscreen.

    That is the one of its `camera_id` or `camera_name`, or else MuJoCo's free camera with the environment's
    `default_camera_config`, aimed at the median of the geoms as they are when the first frame is drawn.

    Parameters
    ----------
    env : gymnasium.Env
        Unwrapped.
    """

    def __init__(self, env: Any) -> None:
        viewer = getattr(env, "mujoco_renderer", None)
        self._index = int(getattr(viewer, "camera_id", -1))
        self._settings: dict[str, Any] = dict(getattr(viewer, "default_cam_config", None) or {})

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> Camera | FixedCamera:
        """The camera at the present time."""
        if self._index >= 0:
            return FixedCamera(
                position=data.cam_xpos[self._index].copy(),
                rotation=data.cam_xmat[self._index].reshape(3, 3).copy(),
                distance=float(model.stat.extent),
                fovy=float(model.cam_fovy[self._index]),
            )
        x, y, z = self._settings.setdefault("lookat", np.median(data.geom_xpos, axis=0))
        return Camera(
            lookat=(float(x), float(y), float(z)),
            distance=float(self._settings.get("distance", model.stat.extent)),
            azimuth=float(self._settings.get("azimuth", _AZIMUTH)),
            elevation=float(self._settings.get("elevation", _ELEVATION)),
            fovy=float(model.vis.global_.fovy),
        )
