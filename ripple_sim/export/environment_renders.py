"""`RenderedInPlace`: an environment's own `render` draws the ripples.

Environments add more than a camera: markers of goals, overlays, settings of their own. Nearly all
of them draw with one of two classes, Gymnasium's `MujocoRenderer` or `mujoco.Renderer`. Within the
context `RenderedInPlace.replacing`, the objects of these classes that draw one model draw through
`RippleRenderer`. The module needs Gymnasium.
"""

from __future__ import annotations

import contextlib
import threading
import weakref
from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import numpy as np
from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer, OffScreenViewer
from numpy.typing import NDArray

from ripple_sim.coupling.geoms import ByGeom
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.solver.errors import warn_caller

from .renderer import RippleRenderer

# Gymnasium's modes in which frames with ripples are drawn.
DRAWN_MODES = ("rgb_array", "depth_array", "rgbd_tuple")

# Entries that a scene may have, as for `mujoco.Renderer`.
_MAX_GEOM = 10_000


def depth_buffer(model: mujoco.MjModel, depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """MuJoCo's depth buffer for depths [m], which Gymnasium returns.

    It is 0 at the near plane and 1 at the far plane.
    """
    near, far = model.stat.extent * np.array([model.vis.map.znear, model.vis.map.zfar])
    share = (1 / near - 1 / depth.astype(np.float64)) / (1 / near - 1 / far)
    return np.clip(share, 0, 1).astype(np.float32)


def frames_of(renderer: RippleRenderer, mode: str) -> Any:
    """Frames as Gymnasium's `render` returns them in one of `DRAWN_MODES`.

    They are colours, uint8 [height, width, 3], the depth buffer, float32 [height, width], or both,
    of the scene that the renderer has taken in.
    """
    frames: list[NDArray] = []
    if mode != "depth_array":
        frames.append(renderer.render())
    if mode != "rgb_array":
        renderer.enable_depth_rendering()
        frames.append(depth_buffer(renderer.model, renderer.render()))
        renderer.disable_depth_rendering()
    return frames[0] if len(frames) == 1 else tuple(frames)


class RippleViewer(OffScreenViewer):
    """Gymnasium's offscreen viewer with frames of `RippleRenderer`.

    Camera, options and markers are Gymnasium's.

    Parameters
    ----------
    renderer : RippleRenderer
    data : mujoco.MjData
    visual_options : mapping, optional
        Flags of `mujoco.MjvOption`.
    """

    def __init__(self, renderer: RippleRenderer, data: mujoco.MjData, visual_options: Any) -> None:
        # Gymnasium's own __init__ makes an OpenGL context, which nothing here needs
        self.model = renderer.model
        self.data = data
        self.viewport = mujoco.MjrRect(0, 0, renderer.width, renderer.height)
        self.cam = mujoco.MjvCamera()
        self.vopt = mujoco.MjvOption()
        self.pert = mujoco.MjvPerturb()
        self._renderer = renderer
        self._markers: list[dict[str, Any]] = []
        self._overlays: dict[int, list[str]] = {}
        self._warned_of_overlays = False
        for flag, value in (visual_options or {}).items():
            self.vopt.flags[flag] = value
        self._init_camera()

    @property
    def scn(self) -> mujoco.MjvScene:
        """The scene that is drawn."""
        return self._renderer.scene

    def render(
        self, render_mode: str | None, camera_id: int | None = None, segmentation: bool = False
    ) -> Any:
        """Draw the present state of the data, as Gymnasium's viewer does."""
        if camera_id is not None:
            is_free = camera_id == -1
            self.cam.type = (
                mujoco.mjtCamera.mjCAMERA_FREE if is_free else mujoco.mjtCamera.mjCAMERA_FIXED
            )
            self.cam.fixedcamid = camera_id
        self._renderer.update_scene(self.data, self.cam, self.vopt)
        for marker in self._markers:
            self._add_marker_to_scene(marker)
        self._markers.clear()
        if self._overlays and not self._warned_of_overlays:
            self._warned_of_overlays = True
            warn_caller("overlays, which are text, are not drawn with ripples")
        if not segmentation:
            return frames_of(self._renderer, render_mode or "rgb_array")
        self._renderer.enable_segmentation_rendering()
        identity = self._renderer.render()
        self._renderer.disable_segmentation_rendering()
        kinds_and_ids = identity[..., ::-1]  # Gymnasium has the type first
        depth = frames_of(self._renderer, "depth_array")
        return {"rgb_array": kinds_and_ids, "depth_array": depth}.get(
            render_mode or "", (kinds_and_ids, depth)
        )

    def make_context_current(self) -> None:
        """Do nothing: each call of our renderer enters its own context."""

    def free(self) -> None:
        """Do nothing: the renderer belongs to `RenderedInPlace`."""

    close = free


class RenderedInPlace:
    """Draws a model with its ripples for the renderers with which an environment draws it.

    Parameters
    ----------
    model : mujoco.MjModel
    ripples : Ripples
    looks : mapping, optional
        As for `RippleRenderer`.
    lighting : str
        Likewise.

    Attributes
    ----------
    frames : int
        How many frames were drawn so far.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        ripples: Ripples,
        looks: ByGeom[str] | None,
        lighting: str = "model",
    ) -> None:
        self._model = model
        self._ripples = ripples
        self._looks = looks
        self._lighting = lighting
        self._renderers: dict[tuple[int, int, int], RippleRenderer] = {}
        self._viewers = weakref.WeakKeyDictionary[MujocoRenderer, dict[str, RippleViewer]]()
        self._taken_in = weakref.WeakSet[mujoco.Renderer]()
        self.frames = 0

    def renderer(self, width: int, height: int, max_geom: int = _MAX_GEOM) -> RippleRenderer:
        """The renderer of frames of a size [pixels], with room for some geoms in its scene."""
        kind = width, height, max_geom
        if kind not in self._renderers:
            self._renderers[kind] = RippleRenderer(
                self._model,
                self._ripples,
                height,
                width,
                max_geom,
                looks=self._looks,
                lighting=self._lighting,
            )
        return self._renderers[kind]

    @contextlib.contextmanager
    def replacing(self) -> Iterator[None]:
        """Within the context draw for each `MujocoRenderer` and `mujoco.Renderer` of this model."""
        with _lock:
            if not _in_place:
                _replace_methods()
            _in_place[id(self._model)] = self
        try:
            yield
        finally:
            with _lock:
                del _in_place[id(self._model)]
                if not _in_place:
                    _restore_methods()
            self._taken_in.clear()

    def close(self) -> None:
        """Release what drawing needs."""
        for renderer in self._renderers.values():
            renderer.close()
        self._renderers.clear()
        self._viewers.clear()

    def viewer(self, drawn_by: MujocoRenderer, mode: str) -> RippleViewer:
        """The viewer that draws for a `MujocoRenderer` in a mode."""
        viewers = self._viewers.setdefault(drawn_by, {})
        is_new = mode not in viewers
        if is_new:
            renderer = self.renderer(drawn_by.width, drawn_by.height, drawn_by.max_geom)
            viewers[mode] = RippleViewer(renderer, drawn_by.data, drawn_by._vopt)
        drawn_by.viewer = viewers[mode]
        if is_new:
            drawn_by._set_cam_config()
        self.frames += 1
        return viewers[mode]

    def update_scene(self, drawn_by: mujoco.Renderer, *args: Any, **kwargs: Any) -> None:
        """Update the scene as a `mujoco.Renderer` does."""
        renderer = self.renderer(drawn_by.width, drawn_by.height)
        renderer.update_scene(*args, **kwargs)
        self._taken_in.add(drawn_by)

    def scene(self, drawn_by: mujoco.Renderer) -> mujoco.MjvScene | None:
        """The scene that is drawn for a `mujoco.Renderer`.

        None if its `update_scene` was not called within the context.
        """
        if drawn_by not in self._taken_in:
            return None
        return self.renderer(drawn_by.width, drawn_by.height).scene

    def render(self, drawn_by: mujoco.Renderer, out: NDArray | None) -> NDArray:
        """Draw the frame as a `mujoco.Renderer` does."""
        renderer = self.renderer(drawn_by.width, drawn_by.height)
        renderer.disable_depth_rendering()
        renderer.disable_segmentation_rendering()
        if drawn_by._depth_rendering:
            renderer.enable_depth_rendering()
        if drawn_by._segmentation_rendering:
            renderer.enable_segmentation_rendering()
        self.frames += 1
        frame = renderer.render(out=out)
        renderer.disable_depth_rendering()
        renderer.disable_segmentation_rendering()
        return frame


_lock = threading.Lock()
# Who draws a model at present, by the id of the model, which is kept alive by its renderers.
_in_place: dict[int, RenderedInPlace] = {}
# The original methods that are replaced meanwhile, by class and name.
_methods: dict[tuple[type, str], Any] = {}


def _replace_methods() -> None:
    replaced: list[tuple[type, str, Callable[[Any], Any]]] = [
        (MujocoRenderer, "_get_viewer", _get_viewer),
        (mujoco.Renderer, "update_scene", _update_scene),
        (mujoco.Renderer, "render", _render),
        (mujoco.Renderer, "scene", _scene),
    ]
    for owner, name, made_from in replaced:
        original = owner.__dict__[name]
        _methods[owner, name] = original
        setattr(owner, name, made_from(original))


def _restore_methods() -> None:
    for (owner, name), original in _methods.items():
        setattr(owner, name, original)
    _methods.clear()


def _get_viewer(original: Any) -> Any:
    def get_viewer(self: MujocoRenderer, render_mode: str | None) -> Any:
        in_place = _in_place.get(id(self.model))
        if in_place is None or render_mode not in DRAWN_MODES:
            return original(self, render_mode)
        return in_place.viewer(self, render_mode)

    return get_viewer


def _update_scene(original: Any) -> Any:
    def update_scene(self: mujoco.Renderer, *args: Any, **kwargs: Any) -> None:
        in_place = _in_place.get(id(self.model))
        if in_place is None:
            original(self, *args, **kwargs)
        else:
            in_place.update_scene(self, *args, **kwargs)

    return update_scene


def _render(original: Any) -> Any:
    def render(self: mujoco.Renderer, *, out: NDArray | None = None) -> NDArray:
        in_place = _in_place.get(id(self.model))
        if in_place is None or in_place.scene(self) is None:
            return original(self, out=out)
        return in_place.render(self, out)

    return render


def _scene(original: property) -> property:
    def scene(self: mujoco.Renderer) -> mujoco.MjvScene:
        in_place = _in_place.get(id(self.model))
        drawn = None if in_place is None else in_place.scene(self)
        return original.__get__(self) if drawn is None else drawn

    return property(scene)
