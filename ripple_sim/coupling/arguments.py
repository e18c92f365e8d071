"""Checks of what a user gives to `Ripples`."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco

from ripple_sim.errors import SceneError
from ripple_sim.solver import Material


def check_arguments(
    model: mujoco.MjModel, materials: Mapping[str, Material], resolution: int | Mapping[str, int]
) -> None:
    """Refuse arguments of a wrong type, and a target without a resolution.

    Raises
    ------
    SceneError
    """
    if not isinstance(model, mujoco.MjModel):
        raise SceneError(f"model is {type(model).__name__}; valid is a compiled mujoco.MjModel")
    if not isinstance(materials, Mapping):
        raise SceneError(f"materials is {type(materials).__name__}; valid is a mapping of geom names to Material")
    for name in materials:
        if not isinstance(materials[name], Material):
            raise SceneError(f"material of geom {name!r} is {materials[name]!r}; valid is a Material")
        if isinstance(resolution, Mapping) and name not in resolution:
            raise SceneError(
                f"resolution has no entry for geom {name!r}; it has {', '.join(map(repr, resolution)) or 'none'}: "
                "give every rippling geom one, or one number for all"
            )


def integrator_warning(model: mujoco.MjModel) -> str | None:
    """What to warn of where the integrator's forces are not those that MuJoCo reports, else None."""
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        return None
    return (
        "the integrator RK4 averages four contact forces in each step, of which MuJoCo keeps only the last: impulses "
        'are off by some per cent; use integrator="implicitfast", or a short time step'
    )
