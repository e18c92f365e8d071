"""`RippleWrapper` makes a MuJoCo environment of Gymnasium ripple."""

from __future__ import annotations

import warnings
from typing import Any

try:
    import gymnasium
    from gymnasium.utils import EzPickle, RecordConstructorArgs
except ImportError as error:
    raise ImportError(
        "ripple_sim.gymnasium needs Gymnasium, which is not installed; install it with: "
        "pip install 'ripple-sim[gymnasium]'"
    ) from error

from ripple_sim.coupling.geoms import ByGeom
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.environment import EnvironmentCamera, frame_size, model_and_data
from ripple_sim.errors import RippleWarning
from ripple_sim.export.ripple_renderer import RippleRenderer
from ripple_sim.solver import Material

_DRAWN = "rgb_array"


class RippleWrapper(gymnasium.Wrapper, EzPickle, RecordConstructorArgs):
    """A MuJoCo environment with ripples on some of its geoms.

    Each physics step within `step` drives the ripples, however many the environment takes (`frame_skip`), and `reset`
    flattens them. `info` has two more entries:

    - `"impulses"`: list of `Impulse`, those that the surfaces received since the last `step` or `reset`;
    - `"heights"`: geom name to the heights of its ripples [m], float32 [C, n, n].

    With `render_mode="rgb_array"`, `render` returns a frame with the ripples, drawn by ripple-sim, of the environment's
    size and from its camera. Other modes draw without them. Observation, reward and their spaces are those of the
    environment. A pickled or copied environment begins anew, as Gymnasium's own ones do.

    Parameters
    ----------
    env : gymnasium.Env
        One whose unwrapped environment has MuJoCo's `model` and `data` (or dm_control's `physics`), and that steps
        through `mujoco.mj_step` or `mujoco.mj_step2`.
    materials : mapping
        Geom to its `Material`, as for `Ripples`.
    looks : mapping, optional
        Geom to its look, as for `RippleRenderer`.
    **options
        Keyword arguments of `Ripples`: resolution, backend, two_way and so on.

    Attributes
    ----------
    ripples : Ripples

    Raises
    ------
    RippleError
        If the environment has no MuJoCo model, or as `Ripples` does.
    """

    _renderer: RippleRenderer | None

    def __init__(
        self,
        env: gymnasium.Env,
        materials: ByGeom[Material],
        *,
        looks: ByGeom[str] | None = None,
        **options: Any,
    ) -> None:
        RecordConstructorArgs.__init__(self, materials=materials, looks=looks, **options)
        EzPickle.__init__(self, env, materials, looks=looks, **options)
        gymnasium.Wrapper.__init__(self, env)
        if self.render_mode not in (None, _DRAWN):
            warnings.warn(
                f'render_mode is {self.render_mode!r}, which shows no ripples; with "{_DRAWN}" `render` returns frames '
                "with them",
                RippleWarning,
                stacklevel=2,
            )
        self._materials, self._looks, self._options = materials, looks, options
        self._camera = EnvironmentCamera(env.unwrapped)
        self._couple()

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the environment, and the ripples with each of its physics steps."""
        _, data = model_and_data(self.unwrapped)
        with self.ripples.following(data):
            observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, reward, terminated, truncated, {**info, **self._info()}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset the environment, and flatten the ripples."""
        observation, info = self.env.reset(seed=seed, options=options)
        model, _ = model_and_data(self.unwrapped)
        if model is self.ripples.model:
            self.ripples.reset()
        else:  # environments may build a new one for each episode
            self._couple()
        return observation, {**info, **self._info()}

    def render(self) -> Any:
        """Return a frame with the ripples in mode "rgb_array", uint8 [height, width, 3]; else as the environment."""
        if self.render_mode != _DRAWN:
            return self.env.render()
        model, data = model_and_data(self.unwrapped)
        if self._renderer is None:
            width, height = frame_size(self.unwrapped)
            self._renderer = RippleRenderer(model, self.ripples, width=width, height=height, looks=self._looks)
        return self._renderer.render(data, self._camera(model, data))

    def close(self) -> None:
        """Close the environment, and release what drawing needs."""
        self._renderer = None
        self.env.close()

    def _couple(self) -> None:
        model, _ = model_and_data(self.unwrapped)
        self.ripples = Ripples(model, self._materials, **self._options)
        self._renderer = None

    def _info(self) -> dict[str, Any]:
        heights = {name: self.ripples[name].height for name in self.ripples}
        return {"impulses": self.ripples.last_impulses, "heights": heights}
