"""Ripples for dm_control: `couple` makes a `Physics` ripple."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import mujoco
from numpy.typing import NDArray

from ripple_sim.coupling.geoms import ByGeom
from ripple_sim.coupling.hooks import hook_physics
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.errors import RenderError
from ripple_sim.export.renderer import RippleRenderer
from ripple_sim.solver import Material
from ripple_sim.solver.errors import warn_caller


def couple(
    physics: Any,
    materials: ByGeom[Material],
    *,
    looks: ByGeom[str] | None = None,
    lighting: str = "model",
    **options: Any,
) -> Ripples:
    """Make a dm_control `Physics` or environment ripple.

    From now on each of its physics steps drives the ripples. `physics.step(nstep)` couples every
    one of its steps, also where dm_control begins the next one already (`legacy_step`), so that
    tasks and environments of dm_control need no change; `physics.reset` flattens the surfaces.
    `physics.render` takes what it took before, and draws with the ripples, through
    `RippleRenderer`; text (`overlays`) is not drawn.

    An environment of `composer` makes a new physics for each episode: give the environment, and the
    ripples are made anew with it, in the same `Ripples`.

    Parameters
    ----------
    physics : dm_control.mujoco.Physics
        Or an environment, of `control` or `composer`.
    materials : mapping
        Geom to its `Material`, as for `Ripples`.
    looks : mapping, optional
        Geom to its look, as for `RippleRenderer`.
    lighting : str
        Lights of the frames: "model", "studio" or "auto".
    **options
        Keyword arguments of `Ripples`.

    Returns
    -------
    Ripples
        `last_impulses` are those of the latest `physics.step`.

    Raises
    ------
    RippleError
        As `Ripples` does.
    """
    environment = physics
    physics = getattr(physics, "physics", physics)
    ripples = Ripples(physics.model, materials, **options)
    _follow(physics, ripples, looks=looks, lighting=lighting)
    if hasattr(environment, "add_extra_hook"):

        def begin_anew(physics: Any, _: Any) -> None:
            Ripples.__init__(ripples, physics.model, materials, **options)
            _follow(physics, ripples, looks=looks, lighting=lighting)

        environment.add_extra_hook("after_compile", begin_anew)
    return ripples


def _render_flag(flag: Any) -> int:
    """Number of a flag of `mujoco.mjtRndFlag`, also by dm_control's name of it: "wireframe"."""
    if not isinstance(flag, str):
        return int(flag)
    number = getattr(mujoco.mjtRndFlag, f"mjRND_{flag.upper()}", None)
    if number is None:
        names = [name for name in mujoco.mjtRndFlag.__members__ if name.startswith("mjRND_")]
        valid = ", ".join(repr(name.removeprefix("mjRND_").lower()) for name in names)
        raise RenderError(f"render flag must be one of {valid}, got {flag!r}")
    return int(number)


@contextlib.contextmanager
def _overridden(scene: mujoco.MjvScene, flags: Mapping[Any, bool]) -> Iterator[None]:
    """Within the context some of a scene's flags have other values."""
    flags_before = scene.flags.copy()
    for flag, value in flags.items():
        scene.flags[_render_flag(flag)] = value
    yield
    scene.flags[:] = flags_before


def _refuse_with_surfaces(**options: Any) -> None:
    """Raise if an option is given that dm_control has for colours alone."""
    for name, value in options.items():
        if value:
            raise RenderError(
                f"{name} are not supported with depth or segmentation; leave {name} empty"
            )


def _follow(physics: Any, ripples: Ripples, **renderer_options: Any) -> None:
    """Have a physics drive the ripples and draw with them.

    `renderer_options` are keyword arguments of `RippleRenderer`.
    """

    @functools.cache
    def renderer_of(height: int, width: int) -> RippleRenderer:
        return RippleRenderer(physics.model, ripples, height, width, **renderer_options)

    # the arguments are those of `Physics.render`, in their order
    def rippling_render(
        height: int = 240,
        width: int = 320,
        camera_id: Any = -1,
        overlays: Any = (),
        depth: bool = False,
        segmentation: bool = False,
        scene_option: Any = None,
        render_flag_overrides: Mapping[Any, bool] | None = None,
        scene_callback: Callable[[Any, mujoco.MjvScene], None] | None = None,
    ) -> NDArray:
        if depth and segmentation:
            raise RenderError(
                "depth and segmentation must not both be True: render them one after the other"
            )
        if depth or segmentation:
            _refuse_with_surfaces(overlays=overlays, render_flag_overrides=render_flag_overrides)
        renderer = renderer_of(height, width)
        renderer.update_scene(physics.data, camera_id, getattr(scene_option, "ptr", scene_option))
        if overlays:
            warn_caller("overlays are not drawn")
        if scene_callback is not None:
            scene_callback(physics, renderer.scene)
        renderer.disable_depth_rendering()
        renderer.disable_segmentation_rendering()
        if depth:
            renderer.enable_depth_rendering()
        if segmentation:
            renderer.enable_segmentation_rendering()
        with _overridden(renderer.scene, render_flag_overrides or {}):
            return renderer.render()

    hook_physics(
        physics,
        around_step=lambda: ripples.following(physics.data),
        after_reset=ripples.reset,
        render=rippling_render,
    )
