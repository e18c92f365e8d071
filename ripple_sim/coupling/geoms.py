"""Geoms, flexes and skins of a MuJoCo model as a user names them, and which of them can ripple."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown

from .ids import GeomId, TargetId, geom_id, is_geom
from .soft import find_soft, soft_name, soft_names

# Types of geoms that can ripple, by MuJoCo's number, with MuJoCo's name in the MJCF.
TARGET_TYPES = {
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}")): name
    for name in ("mesh", "sdf", "sphere", "ellipsoid", "capsule", "cylinder", "box", "hfield")
}

# Largest number of geoms that a message lists.
_MAX_LISTED = 40

# A geom as a user names it: by its name, "body/index", "geom <id>", or its id.
GeomKey = str | int

Value = TypeVar("Value")

# Values by geom. For a type checker, a mapping of names alone, or of ids alone, is another type
# than a mapping of both.
ByGeom = Mapping[str, Value] | Mapping[int, Value] | Mapping[GeomKey, Value]


def geom_name(model: mujoco.MjModel, geom: GeomId) -> str:
    """Name of a geom.

    A geom without a name is called "body/index", by its index among the geoms of its body; a body
    without a name counts as "body <id>". If another geom has that name, it is "geom <id>".
    """
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom)
    if name:
        return str(name)
    body = int(model.geom_bodyid[geom])
    body_name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)
    index = geom - int(model.body_geomadr[body])
    place = f"{body_name or f'body {body}'}/{index}"
    is_taken = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, place) >= 0
    return f"geom {geom}" if is_taken else place


def find_geom(model: mujoco.MjModel, key: GeomKey) -> GeomId:
    """Id of a geom, by its name, "body/index" (also where it has a name), "geom <id>", or its id.

    Raises `SceneError` if there is no such geom.
    """
    if isinstance(key, (int, np.integer)) and 0 <= key < model.ngeom:
        return geom_id(int(key))
    if isinstance(key, str):
        geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, key)
        if geom >= 0:
            return GeomId(geom)
        body_name, slash, index = key.rpartition("/")
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body_name) if slash else -1
        if body >= 0 and index.isdecimal() and int(index) < model.body_geomnum[body]:
            return geom_id(int(model.body_geomadr[body]) + int(index))
    names = [geom_name(model, geom_id(i)) for i in range(model.ngeom)]
    numbered_names = [f"geom {i}" for i in range(model.ngeom)]
    for name_list in (names, numbered_names):
        if isinstance(key, str) and key in name_list:
            return geom_id(name_list.index(key))
    listed = ", ".join(map(repr, names[:_MAX_LISTED])) or "none"
    if model.ngeom > _MAX_LISTED:
        listed += f" and {model.ngeom - _MAX_LISTED} more"
    if soft_names(model):
        listed += f"; its flexes and skins are {', '.join(map(repr, soft_names(model)))}"
    raise SceneError(
        f"the model has no geom {key!r}; its geoms are {listed}: give a name, "
        '"body/index", or an id'
    )


def target_name(model: mujoco.MjModel, target: TargetId) -> str:
    """Name of a geom, see `geom_name`, or of a soft target."""
    return geom_name(model, target) if is_geom(target, model) else soft_name(model, target)


def find_target(model: mujoco.MjModel, key: GeomKey) -> TargetId:
    """Id of a target: a geom, see `find_geom`, or a flex or a skin, see `find_soft`.

    Raises `SceneError` if there is nothing of that name, or a geom's type has no closed surface.
    """
    target = find_any(model, key)
    if is_geom(target, model) and int(model.geom_type[target]) not in TARGET_TYPES:
        kind = mujoco.mjtGeom(model.geom_type[target]).name.removeprefix("mjGEOM_").lower()
        raise SceneError(
            f"geom {key!r} is a {kind}, which cannot ripple; a target must be one of "
            f"{', '.join(TARGET_TYPES.values())}"
        )
    return target


def by_name(model: mujoco.MjModel, values: ByGeom[Value], title: str) -> dict[str, Value]:
    """Values by the names that `target_name` gives to their geoms, flexes and skins.

    `title` names the values in messages. Raises `SceneError` if they are no mapping, or a geom is
    missing, or has two values.
    """
    if not isinstance(values, Mapping):
        raise SceneError(f"{title} must be a dict with a value for each geom, got {shown(values)}")
    value_by_name: dict[str, Value] = {}
    for key, value in values.items():
        name = target_name(model, find_any(model, key))
        if name in value_by_name:
            raise SceneError(
                f"{title} must have one entry for geom {name!r}, got two, one of them as {key!r}"
            )
        value_by_name[name] = value
    return value_by_name


def find_any(model: mujoco.MjModel, key: GeomKey) -> TargetId:
    """Id of a geom of any type, or of the flex or skin of a name.

    Raises `SceneError` if there is nothing of that name.
    """
    soft = find_soft(model, key)
    if soft is not None and mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, str(key)) < 0:
        return soft
    return find_geom(model, key)


def to_body(
    model: mujoco.MjModel, target: TargetId, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Points [..., 3] [m] of a target's atlas in the frame of the geom's body.

    Points of a flex or a skin are in the world, and stay.
    """
    if is_geom(target, model):
        return points @ rotation_in_body(model, target).T + model.geom_pos[target]
    return points


def rotation_in_body(model: mujoco.MjModel, geom: GeomId) -> NDArray[np.float64]:
    """Rotation [3, 3] of a geom in the frame of its body, with its axes as columns."""
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    return rotation.reshape(3, 3)
