"""Ripples for dm_control: `couple` makes a `Physics` ripple."""

from __future__ import annotations

from typing import Any

from ripple_sim.coupling.geoms import ByGeom
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.solver import Material


def couple(physics: Any, materials: ByGeom[Material], **options: Any) -> Ripples:
    """Make a dm_control `Physics` ripple: from now on each of its physics steps drives the ripples.

    `physics.step(nstep)` couples every one of its steps, also where dm_control begins the next one already
    (`legacy_step`), so that tasks and environments of dm_control need no change; `physics.reset` flattens the surfaces.
    To draw, give `physics.model`, the ripples and `physics.data` to a `RippleRenderer`.

    Parameters
    ----------
    physics : dm_control.mujoco.Physics
    materials : mapping
        Geom to its `Material`, as for `Ripples`.
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
    ripples = Ripples(physics.model, materials, **options)
    step, reset = physics.step, physics.reset

    def rippling_step(*args: Any, **kwargs: Any) -> None:
        with ripples.following(physics.data):
            step(*args, **kwargs)

    def rippling_reset(*args: Any, **kwargs: Any) -> None:
        reset(*args, **kwargs)
        ripples.reset()

    physics.step, physics.reset = rippling_step, rippling_reset
    return ripples
