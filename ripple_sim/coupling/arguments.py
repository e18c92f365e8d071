"""What a user gives to `Ripples`: checked, and taken out of other libraries' wrappers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import mujoco

from ripple_sim.errors import SceneError
from ripple_sim.solver import Material

from .geoms import ByGeom, Value, by_name, find_target

# Numbers that two models of one signature share.
_SIZES = ("nq", "nv", "nu", "nbody", "ngeom")

# Of physics [s]: no contact is met in longer ones.
_LONGEST_STEP = 1.0


def own_model(model: Any) -> mujoco.MjModel:
    """MuJoCo's model itself, also of dm_control's wrapper.

    Raises
    ------
    SceneError
        If it is something else.
    """
    found = getattr(model, "ptr", model)
    if not isinstance(found, mujoco.MjModel):
        raise SceneError(f"model is {type(model).__name__}; valid is a compiled mujoco.MjModel, or dm_control's")
    if not 0 < found.opt.timestep <= _LONGEST_STEP:
        raise SceneError(
            f"the model's timestep is {found.opt.timestep:g} s; valid is a number greater than 0 and up to "
            f"{_LONGEST_STEP:g}, such as 0.002 (<option timestep=...>)"
        )
    return found


def own_data(model: mujoco.MjModel, data: Any) -> mujoco.MjData:
    """MuJoCo's data itself, also of dm_control's wrapper.

    Raises
    ------
    SceneError
        If it is something else, or belongs to another model.
    """
    found = data if isinstance(data, mujoco.MjData) else getattr(data, "ptr", None)
    if not isinstance(found, mujoco.MjData):
        raise SceneError(f"data is {type(data).__name__}; valid is a mujoco.MjData, or dm_control's")
    # MuJoCo drops signatures in pickling; then sizes have to do
    if found.signature != model.signature and (
        (found.signature and model.signature) or _sizes(found.model) != _sizes(model)
    ):
        raise SceneError(
            f"data belongs to another model ({_sizes(found.model)}) than that of the ripples ({_sizes(model)}): give "
            "step the data of the latter, or make new Ripples for the former"
        )
    return found


def _sizes(model: mujoco.MjModel) -> str:
    """What tells models apart: name, and how much they have of everything."""
    name = model.names.split(b"\0", 1)[0].decode()
    return ", ".join([repr(name), *(f"{size} {getattr(model, size)}" for size in _SIZES)])


def checked_materials(model: mujoco.MjModel, materials: ByGeom[Material]) -> dict[str, Material]:
    """Materials by the names of their geoms.

    Raises
    ------
    SceneError
        For arguments of a wrong type, a geom that cannot ripple, or one that has two materials.
    """
    if not isinstance(materials, Mapping):
        raise SceneError(f"materials is {type(materials).__name__}; valid is a mapping of geom names to Material")
    for key, material in materials.items():
        find_target(model, key)
        if not isinstance(material, Material):
            raise SceneError(f"material of geom {key!r} is {material!r}; valid is a Material")
    return by_name(model, materials, "materials")


def for_each(model: mujoco.MjModel, names: Iterable[str], what: str, value: Value | ByGeom[Value]) -> dict[str, Value]:
    """What an argument says for each target, by name: one value for all, or a mapping.

    Raises
    ------
    SceneError
        For a target that a mapping leaves out.
    """
    if not isinstance(value, Mapping):
        return dict.fromkeys(names, value)
    given = by_name(model, value, what)
    for name in names:
        if name not in given:
            raise SceneError(
                f"{what} has no entry for geom {name!r}; it has {', '.join(map(repr, given)) or 'none'}: "
                f"give every rippling geom one, or one {what} for all"
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
