"""`RippleWrapper` makes a MuJoCo environment of Gymnasium ripple.

It reads the environment's model and data, the size of its frames, and its camera.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.geoms import ByGeom
from ripple_sim.coupling.own_model import own_data, own_model
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.coupling.sensor_data import SampleBlocks
from ripple_sim.coupling.user_sensors import user_sensors
from ripple_sim.errors import RippleError, SceneError
from ripple_sim.solver import Material
from ripple_sim.solver.errors import warn_caller

try:
    import gymnasium
    from gymnasium.utils import EzPickle, RecordConstructorArgs

    from ripple_sim.export.environment_renders import DRAWN_MODES, RenderedInPlace, frames_of
except ImportError as error:
    raise ImportError(
        "ripple_sim.gymnasium needs Gymnasium, which is not installed; install it with: pip "
        "install 'ripple-sim[gymnasium]'"
    ) from error

# Width and height of frames where an environment gives none [pixels].
_DEFAULT_SIZE = 480

# Share of the samples in a control step by which they may differ from a whole number.
_ROUND_OFF = 1e-6


def model_and_data(env: Any) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Model and data of an unwrapped environment: its own, or those of its dm_control `physics`.

    Raises `SceneError` if it has none.
    """
    holder = getattr(env, "physics", env)
    if not (hasattr(holder, "model") and hasattr(holder, "data")):
        raise SceneError(
            f"the environment {env} has no `model` and `data`: it must be a MuJoCo environment, "
            "such as one derived from gymnasium.envs.mujoco.MujocoEnv"
        )
    model = own_model(holder.model)
    return model, own_data(model, holder.data)


def frame_size(env: Any) -> tuple[int, int]:
    """Width and height of an environment's frames [pixels]."""
    viewer = getattr(env, "mujoco_renderer", env)
    width = getattr(viewer, "width", None) or _DEFAULT_SIZE
    height = getattr(viewer, "height", None) or _DEFAULT_SIZE
    return width, height


def environment_camera(
    env: Any, model: mujoco.MjModel, lookat: NDArray[np.float64]
) -> mujoco.MjvCamera:
    """The camera with which an unwrapped `MujocoEnv` renders offscreen.

    That is the one of its `camera_id` or `camera_name`, or else MuJoCo's free camera with the
    environment's `default_camera_config`, aimed at a point [m]: in Gymnasium the median of the
    geoms when the first frame is drawn.
    """
    viewer = getattr(env, "mujoco_renderer", None)
    camera = mujoco.MjvCamera()
    camera.lookat = lookat
    camera.distance = model.stat.extent
    for name, value in (getattr(viewer, "default_cam_config", None) or {}).items():
        setattr(camera, name, value)
    camera.fixedcamid = int(getattr(viewer, "camera_id", -1))
    is_free = camera.fixedcamid == -1
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE if is_free else mujoco.mjtCamera.mjCAMERA_FIXED
    return camera


class RippleWrapper(gymnasium.Wrapper, EzPickle, RecordConstructorArgs):
    """A MuJoCo environment with ripples on some of its geoms.

    Each physics step within `step` drives the ripples, however many the environment takes
    (`frame_skip`), and `reset` flattens them. `info` has two more entries:

    - `"impulses"`: list of `Impulse`, those that the surfaces received since the last `step` or
      `reset`;
    - `"heights"`: geom name to the heights of its ripples [m], float32 [C, n, n].

    With the modes "rgb_array", "depth_array" and "rgbd_tuple", `render` returns what Gymnasium's
    own would, with the ripples: the environment's own `render` runs, with its camera and its
    markers; ripple-sim draws instead of Gymnasium's `MujocoRenderer` or `mujoco.Renderer`.
    Where it uses neither, the model is drawn with MuJoCo's free camera, and a warning says so.
    Other modes draw without ripples. Observation, reward and their spaces are those of the
    environment. A pickled or copied environment begins anew, as Gymnasium's own ones do.

    Parameters
    ----------
    env : gymnasium.Env
        One whose unwrapped environment has MuJoCo's `model` and `data` (or dm_control's `physics`),
        and that steps through `mujoco.mj_step` or `mujoco.mj_step2`.
    materials : mapping
        Geom to its `Material`, as for `Ripples`.
    looks : mapping, optional
        Geom to its look, as for `RippleRenderer`.
    lighting : str
        What lights the frames, as for `RippleRenderer`: "model", "studio" or "auto".
    sensors : mapping or sequence of str, optional
        Names of sensors that `add_sensor` has added to the model; or a mapping of a name to the
        arguments of a sensor: its `geom`, and those of `WaveSolver.sensor`, as in
        `{"tap": {"geom": "board", "at": "site", "rate": 2000}}`. The observation is then a `Dict`:
        what it was, under "observation" unless it is one already, and under each name the samples
        of a control step, float32 [samples, points], in one unbroken row from step to step, late by
        the sensor's `latency`, 0 before the reset. Their spaces have no bounds: nothing limits how
        hard a body may hit.
    **options
        Keyword arguments of `Ripples`: resolution, backend, two_way and so on.

    Attributes
    ----------
    ripples : Ripples

    Raises
    ------
    RippleError
        If the environment has no MuJoCo model, a sensor's rate gives no whole number of samples in
        a control step, or its name is taken, or as `Ripples` does.
    """

    _in_place: RenderedInPlace | None

    def __init__(
        self,
        env: gymnasium.Env,
        materials: ByGeom[Material],
        *,
        looks: ByGeom[str] | None = None,
        lighting: str = "model",
        sensors: Mapping[str, Mapping[str, Any]] | Sequence[str] | None = None,
        **options: Any,
    ) -> None:
        arguments = {"looks": looks, "lighting": lighting, "sensors": sensors, **options}
        RecordConstructorArgs.__init__(self, materials=materials, **arguments)
        EzPickle.__init__(self, env, materials, **arguments)
        gymnasium.Wrapper.__init__(self, env)
        if self.render_mode not in (None, *DRAWN_MODES):
            warn_caller(
                f"render_mode is {self.render_mode!r}, which shows no ripples; with "
                f"{', '.join(map(repr, DRAWN_MODES))} `render` returns frames with them"
            )
        self._materials = materials
        self._looks = looks
        self._options = options
        self._lighting = lighting
        # where MuJoCo's free camera looks [m], once it is used
        self._lookat: NDArray[np.float64] | None = None
        self._renders_by_itself = True
        self._in_place = None
        self._sensor_requests = sensors or {}
        # samples of each sensor, by control step
        self._blocks: dict[str, SampleBlocks] = {}
        self._couple()
        if self._sensor_requests:
            self.observation_space = self._space_with_sensors()

    def _space_with_sensors(self) -> gymnasium.spaces.Dict:
        """The environment's space of observations, with those of the sensors beside it."""
        env_space = self.env.observation_space
        if isinstance(env_space, gymnasium.spaces.Dict):
            spaces = dict(env_space.spaces)
        else:
            spaces = {"observation": env_space}
        for name, blocks in self._blocks.items():
            if name in spaces:
                raise SceneError(
                    f"the name of a sensor must be none of {', '.join(map(repr, spaces))}, got "
                    f"{name!r}"
                )
            shape = blocks.count, len(blocks.sensor.points)
            spaces[name] = gymnasium.spaces.Box(-np.inf, np.inf, shape, np.float32)
        return gymnasium.spaces.Dict(spaces)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the environment, and the ripples with each of its physics steps."""
        _, data = model_and_data(self.unwrapped)
        with self.ripples.following(data):
            observation, reward, terminated, truncated, info = self.env.step(action)
        return self._sensed(observation), reward, terminated, truncated, {**info, **self._info()}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset the environment, and flatten the ripples."""
        observation, info = self.env.reset(seed=seed, options=options)
        model, _ = model_and_data(self.unwrapped)
        if model is self.ripples.model:
            self.ripples.reset()
        else:  # environments may build a new one for each episode
            self._couple()
        for blocks in self._blocks.values():
            blocks.clear()
        return self._sensed(observation), {**info, **self._info()}

    def render(self) -> Any:
        """Return a frame, its depth buffer, or both, by the mode.

        A frame is uint8 [height, width, 3], a depth buffer float32 [height, width]. The depth
        buffer is 0 at MuJoCo's near plane and 1 at its far one. Other modes are the environment's.
        """
        if self.render_mode not in DRAWN_MODES:
            return self.env.render()
        model, _ = model_and_data(self.unwrapped)
        if self._in_place is None:
            self._in_place = RenderedInPlace(model, self.ripples, self._looks, self._lighting)
        if not self._renders_by_itself:
            return self._drawn_from_outside(self._in_place)
        frames_before = self._in_place.frames
        problem: str | None = (
            "returns frames that neither Gymnasium's MujocoRenderer nor mujoco.Renderer has drawn"
        )
        try:
            with self._in_place.replacing():
                frame = self.env.render()
        except (gymnasium.error.Error, RippleError):
            raise
        except NotImplementedError:  # the environment has no render of its own
            problem = None
        except Exception as error:
            if self._in_place.frames > frames_before:
                raise
            problem = f"fails ({type(error).__name__}: {error})"
        if self._in_place.frames > frames_before:
            return frame
        self._renders_by_itself = False
        if problem is not None:
            warn_caller(
                f"the environment's own render {problem}; the model is drawn with MuJoCo's free "
                "camera in its place, without what that render adds"
            )
        return self._drawn_from_outside(self._in_place)

    def close(self) -> None:
        """Close the environment, and release what drawing needs."""
        if self._in_place is not None:
            self._in_place.close()
        self._in_place = None
        self.env.close()

    def _drawn_from_outside(self, in_place: RenderedInPlace) -> Any:
        """A frame of an environment whose own `render` cannot be drawn for."""
        model, data = model_and_data(self.unwrapped)
        if self._lookat is None:
            self._lookat = np.median(data.geom_xpos, axis=0)
        option = mujoco.MjvOption()
        flags = getattr(getattr(self.unwrapped, "mujoco_renderer", None), "_vopt", None) or {}
        for flag, value in flags.items():
            option.flags[flag] = value
        renderer = in_place.renderer(*frame_size(self.unwrapped))
        renderer.update_scene(data, environment_camera(self.unwrapped, model, self._lookat), option)
        return frames_of(renderer, self.render_mode)

    def _couple(self) -> None:
        """Make the ripples of the environment's present model, and their sensors."""
        model, _ = model_and_data(self.unwrapped)
        self.ripples = Ripples(model, self._materials, **self._options)
        if self._in_place is not None:
            self._in_place.close()
        self._in_place = None
        self._blocks.clear()
        control_step = float(getattr(self.unwrapped, "dt", 0.0))  # [s]
        for name, arguments in _sensor_arguments(model, self._sensor_requests).items():
            sensor_arguments = {key: value for key, value in arguments.items() if key != "geom"}
            sensor = self.ripples[arguments["geom"]].sensor(**sensor_arguments)
            count = sensor.rate * control_step
            if round(count) < 1 or abs(count - round(count)) > _ROUND_OFF * count:
                raise SceneError(
                    f"samples of sensor {name!r} in a control step of {control_step:g} s must be a "
                    f"whole number, got {count:g}; choose the rate accordingly"
                )
            self._blocks[name] = SampleBlocks(sensor, round(count))

    def _sensed(self, observation: Any) -> Any:
        """An observation with the next block of each sensor, if there are any."""
        if not self._blocks:
            return observation
        samples = {name: blocks.latest() for name, blocks in self._blocks.items()}
        if isinstance(self.env.observation_space, gymnasium.spaces.Dict):
            return {**observation, **samples}
        return {"observation": observation, **samples}

    def _info(self) -> dict[str, Any]:
        """The entries of `info` that are about the ripples."""
        heights = {name: self.ripples[name].height for name in self.ripples}
        return {"impulses": self.ripples.last_impulses, "heights": heights}


def _sensor_arguments(
    model: mujoco.MjModel, requests: Mapping[str, Mapping[str, Any]] | Sequence[str]
) -> Mapping[str, Mapping[str, Any]]:
    """Arguments of each sensor, by name; those of the model's own sensors are in the model."""
    if isinstance(requests, Mapping):
        return requests
    records = {record.name: record for record in user_sensors(model)}
    arguments = {}
    for name in [requests] if isinstance(requests, str) else requests:
        if name not in records:
            names = ", ".join(map(repr, records)) or "none"
            raise SceneError(
                f"sensors must be names of sensors that add_sensor has added to the model, or a "
                f"mapping, got {name!r}; the model's sensors are {names}"
            )
        record = records[name]
        arguments[name] = {
            "geom": record.geom,
            "at": record.site,
            "kind": record.kind,
            "rate": record.rate,
            "thickness": record.thickness,
        }
    return arguments
