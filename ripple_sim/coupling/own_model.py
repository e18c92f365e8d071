"""Models and data as users give them: unwrapped, and checked to belong together."""

from __future__ import annotations

import copy
import operator
from collections.abc import Mapping
from typing import Any
from weakref import WeakKeyDictionary, WeakSet

import mujoco
import numpy as np

from ripple_sim.errors import SceneError

from .geoms import target_name
from .ids import TargetId

# Counts by which messages tell models apart.
_SIZES = ("nq", "nv", "nu", "nbody", "ngeom")

# Beginnings of the names of the arrays that say what is where, and of what shape.
_SHAPES = (
    "body_parentid",
    "geom_type",
    "geom_size",
    "geom_bodyid",
    "geom_dataid",
    "geom_pos",
    "geom_quat",
    "mesh_vert",
    "mesh_face",
    "flex_vert",
    "flex_elem",
    "skin_vert",
    "skin_face",
)

# Beginnings of the names of the arrays that say how bodies move and collide.
_DYNAMICS = ("body_", "jnt_", "dof_", "geom_", "mesh_", "flex_", "skin_")

# Endings of the names of the arrays that only say how bodies look.
_LOOKS = ("_rgba", "_matid", "_group", "_user")

# Arrays of a model whose numbers are checked.
_CHECKED = (
    "opt.gravity",
    "opt.wind",
    "body_pos",
    "body_quat",
    "body_mass",
    "geom_pos",
    "geom_size",
    "qpos0",
)

# Longest time step of the physics [s]: in a longer one no contact is met.
_MAX_TIMESTEP = 1.0

# Models that were found to be copies of one another stay so, whatever is changed in them later.
_copies: WeakKeyDictionary[mujoco.MjModel, WeakSet[mujoco.MjModel]] = WeakKeyDictionary()


def own_model(model: Any) -> mujoco.MjModel:
    """MuJoCo's model itself, also of dm_control's wrapper.

    Raises `SceneError` if it is something else, or has a time step, a place, a size, a mass or a
    gravity out of range.
    """
    unwrapped = getattr(model, "ptr", model)
    if not isinstance(unwrapped, mujoco.MjModel):
        raise SceneError(
            f"model must be a compiled mujoco.MjModel, or dm_control's, got {type(model).__name__}"
        )
    if not 0 < unwrapped.opt.timestep <= _MAX_TIMESTEP:
        raise SceneError(
            f"the model's timestep must be greater than 0 and up to {_MAX_TIMESTEP:g} s, such "
            f"as 0.002 (<option timestep=...>), got {unwrapped.opt.timestep:g} s"
        )
    for name in _CHECKED:
        values = operator.attrgetter(name)(unwrapped)
        invalid = values[~(np.abs(values) <= mujoco.mjMAXVAL)]  # NaN, too
        if len(invalid):
            raise SceneError(
                f"the model's {name} must hold numbers up to {mujoco.mjMAXVAL:g}, got "
                f"{invalid[0]:g}"
            )
    return unwrapped


def own_data(model: mujoco.MjModel, data: Any, *, drawn: bool = False) -> mujoco.MjData:
    """MuJoCo's data itself, also of dm_control's wrapper.

    The data belongs to `model`, even if that was changed since, or to a copy in which bodies move
    and collide alike. Data that is only `drawn` may have a model with other numbers in the same
    arrays, as for `mujoco.Renderer`: sizes and colours are then those of `model`. Raises
    `SceneError` if `data` is something else, or belongs to another model.
    """
    unwrapped = data if isinstance(data, mujoco.MjData) else getattr(data, "ptr", None)
    if not isinstance(unwrapped, mujoco.MjData):
        raise SceneError(
            f"data must be a mujoco.MjData, or dm_control's, got {type(data).__name__}"
        )
    other = unwrapped.model
    if other is model or other in _copies.get(model, ()):
        return unwrapped
    differing: str | None = None
    if not (unwrapped.signature and model.signature):
        # MuJoCo drops signatures in pickling, and gives the data a model of its own
        if _sizes(other) != _sizes(model):
            differing = "sizes"
    elif unwrapped.signature != model.signature:
        differing = "signature"
    elif not drawn:
        differing = _differing(model, other, _DYNAMICS)
    if differing:
        raise SceneError(
            f"data belongs to another model ({_sizes(other)}) than that of the ripples "
            f"({_sizes(model)}), of another {differing}: give step the data of the latter, "
            "mujoco.MjData(model), or make new Ripples for the former"
        )
    if not drawn:
        _copies.setdefault(model, WeakSet()).add(other)
    return unwrapped


def check_targets(
    model: mujoco.MjModel, other: mujoco.MjModel, targets: Mapping[str, TargetId]
) -> None:
    """Make sure that another model has the same targets as the model to be drawn.

    `targets` are ids in the `other` model, by name. Raises `SceneError` if any geom has
    another shape or place, or a target another name.
    """
    if model is other:
        return
    differing = _differing(model, other, _SHAPES)
    if differing is None:
        for name, target in targets.items():
            if target_name(model, target) != name:
                differing = "names of geoms"
    if differing:
        raise SceneError(
            f"the ripples belong to another model ({_sizes(other)}) than the one to be drawn "
            f"({_sizes(model)}), of another {differing}: draw ripples.model, or make new Ripples "
            "for the latter"
        )


def posed(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData:
    """The data, or a copy with poses where none were ever computed.

    The copy has the poses of its `qpos`, as `mj_forward` computes them.
    """
    has_poses = data.xquat[0].any()  # the world's quaternion is 0 before the first computation
    if has_poses:
        return data
    data = copy.copy(data)
    for compute in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex):
        compute(model, data)
    return data


def _differing(model: mujoco.MjModel, other: mujoco.MjModel, kinds: tuple[str, ...]) -> str | None:
    """Name of the first array that differs between two models, among names that begin so."""
    for name in dir(model):
        if not name.startswith(kinds) or name.endswith(_LOOKS):
            continue
        if not np.array_equal(getattr(model, name), getattr(other, name)):
            return name
    return None


def _sizes(model: mujoco.MjModel) -> str:
    """The name of a model and its counts, for messages."""
    name = model.names.split(b"\0", 1)[0].decode()
    return ", ".join([repr(name), *(f"{size} {getattr(model, size)}" for size in _SIZES)])
