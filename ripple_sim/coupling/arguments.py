"""Checks of what a user gives to `Ripples`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import mujoco

from ripple_sim.coupling.model.geoms import ByGeom, by_name, find_target
from ripple_sim.errors import SceneError
from ripple_sim.solver import Material


def checked_materials(model: mujoco.MjModel, materials: ByGeom[Material]) -> dict[str, Material]:
    """Materials by the names of their geoms.

    Raises
    ------
    SceneError
        For arguments of a wrong type, a geom that cannot ripple, or one that has two materials.
    """
    if not isinstance(model, mujoco.MjModel):
        raise SceneError(f"model is {type(model).__name__}; valid is a compiled mujoco.MjModel")
    if not isinstance(materials, Mapping):
        raise SceneError(f"materials is {type(materials).__name__}; valid is a mapping of geom names to Material")
    for key, material in materials.items():
        find_target(model, key)
        if not isinstance(material, Material):
            raise SceneError(f"material of geom {key!r} is {material!r}; valid is a Material")
    return by_name(model, materials, "materials")


def resolutions(model: mujoco.MjModel, names: Iterable[str], resolution: int | ByGeom[int]) -> dict[str, int]:
    """Resolution of each target, by name.

    Raises
    ------
    SceneError
        For a target without one.
    """
    if not isinstance(resolution, Mapping):
        return dict.fromkeys(names, resolution)
    given = by_name(model, resolution, "resolution")
    for name in names:
        if name not in given:
            raise SceneError(
                f"resolution has no entry for geom {name!r}; it has {', '.join(map(repr, given)) or 'none'}: "
                "give every rippling geom one, or one number for all"
            )
    return {name: given[name] for name in names}


def integrator_warning(model: mujoco.MjModel) -> str | None:
    """What to warn of where the integrator's forces are not those that MuJoCo reports, else None."""
    if model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
        return None
    return (
        "the integrator RK4 averages four contact forces in each step, of which MuJoCo keeps only the last: impulses "
        'are off by some per cent; use integrator="implicitfast", or a short time step'
    )
