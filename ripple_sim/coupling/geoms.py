"""Geoms of a MuJoCo model as a user names them, and the checks of what is given to `Ripples`.

What geoms are called and which can ripple; models and data, also in other libraries' wrappers, and whether they belong
together; arguments by geom; and collision geoms, which collide in place of a target, as models of robots have them.
"""

from __future__ import annotations

import copy
import operator
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar
from weakref import WeakKeyDictionary, WeakSet

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError
from ripple_sim.solver.errors import shown

from .soft import find_soft, is_soft, soft_name, soft_names

TARGET_TYPES = {
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}")): name
    for name in ("mesh", "sdf", "sphere", "ellipsoid", "capsule", "cylinder", "box", "hfield")
}
# So many geoms are listed in a message.
_LISTED = 40

GeomKey = str | int
Value = TypeVar("Value")
# values by geom; a mapping of names alone, or of ids alone, is another type than one of both
ByGeom = Mapping[str, Value] | Mapping[int, Value] | Mapping[GeomKey, Value]


def geom_name(model: mujoco.MjModel, geom: int) -> str:
    """Name of a geom; without one "body/index", its index among the geoms of its body; or else "geom <id>"."""
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom)
    if name:
        return str(name)
    body = int(model.geom_bodyid[geom])
    body_name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body)
    place = f"{body_name}/{geom - int(model.body_geomadr[body])}"
    # another geom may be called so
    taken = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, place) >= 0
    return place if body_name and not taken else f"geom {geom}"


def find_geom(model: mujoco.MjModel, key: GeomKey) -> int:
    """Id of a geom, by its name, "body/index" (also where it has a name), "geom <id>", or its id.

    Raises `SceneError` if there is no such geom.
    """
    if isinstance(key, (int, np.integer)) and 0 <= key < model.ngeom:
        return int(key)
    if isinstance(key, str):
        geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, key)
        if geom >= 0:
            return int(geom)
        body_name, slash, index = key.rpartition("/")
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body_name) if slash else -1
        if body >= 0 and index.isdecimal() and int(index) < model.body_geomnum[body]:
            return int(model.body_geomadr[body]) + int(index)
    names = [geom_name(model, geom) for geom in range(model.ngeom)]
    if isinstance(key, str) and key in names:
        return names.index(key)
    more = f" and {model.ngeom - _LISTED} more" if model.ngeom > _LISTED else ""
    soft = f"; its flexes and skins are {', '.join(map(repr, soft_names(model)))}" if soft_names(model) else ""
    raise SceneError(
        f"the model has no geom {key!r}; its geoms are {', '.join(map(repr, names[:_LISTED])) or 'none'}{more}{soft}: "
        'give a name, "body/index", or an id'
    )


def target_name(model: mujoco.MjModel, target: int) -> str:
    """Name of a geom, see `geom_name`, or of a soft target."""
    return soft_name(model, target) if is_soft(model, target) else geom_name(model, target)


def find_target(model: mujoco.MjModel, key: GeomKey) -> int:
    """Id of what is to ripple: a geom, see `find_geom`, or else the flex or skin of a name, see `find_soft`.

    Raises `SceneError` if there is nothing of that name, or a geom's type has no closed surface.
    """
    geom = find_any(model, key)
    if not is_soft(model, geom) and int(model.geom_type[geom]) not in TARGET_TYPES:
        kind = mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
        raise SceneError(f"geom {key!r} is a {kind}, which cannot ripple; valid are {', '.join(TARGET_TYPES.values())}")
    return geom


def by_name(model: mujoco.MjModel, values: ByGeom[Value], what: str) -> dict[str, Value]:
    """Values by the names that `target_name` gives to their geoms, flexes and skins.

    Raises `SceneError` if they are no mapping, or a geom is missing, or has two values.
    """
    if not isinstance(values, Mapping):
        raise SceneError(f"{what} is {shown(values)}; valid is a dict of them by geom")
    found: dict[str, Value] = {}
    for key, value in values.items():
        name = target_name(model, find_any(model, key))
        if name in found:
            raise SceneError(f"{what} has two entries for geom {name!r}, one of them as {key!r}; valid is one")
        found[name] = value
    return found


def find_any(model: mujoco.MjModel, key: GeomKey) -> int:
    """Id of a geom, whatever its type, or else of the flex or skin of a name.

    Raises `SceneError` if there is nothing of that name.
    """
    soft = find_soft(model, key)
    if soft >= 0 and mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, str(key)) < 0:
        return soft
    return find_geom(model, key)


# Numbers that two models of one signature share.
_SIZES = ("nq", "nv", "nu", "nbody", "ngeom")

# Beginnings of the names of the arrays that say what is where and of what shape, and of those that say how it moves and
# collides; and endings of those that only say how it looks.
_SHAPES = (
    "body_parentid", "geom_type", "geom_size", "geom_bodyid", "geom_dataid", "geom_pos", "geom_quat", "mesh_vert",
    "mesh_face", "flex_vert", "flex_elem", "skin_vert", "skin_face",
)  # fmt: skip
_DYNAMICS = ("body_", "jnt_", "dof_", "geom_", "mesh_", "flex_", "skin_")
_LOOKS = ("_rgba", "_matid", "_group", "_user")

# Models that were found to be copies of one another stay so, whatever is changed in them later.
_copies: WeakKeyDictionary[mujoco.MjModel, WeakSet[mujoco.MjModel]] = WeakKeyDictionary()

# Of physics [s]: no contact is met in longer ones.
_LONGEST_STEP = 1.0


def own_model(model: Any) -> mujoco.MjModel:
    """MuJoCo's model itself, also of dm_control's wrapper.

    Raises `SceneError` if it is something else, or has a time step, a place, a size, a mass or a gravity out of range.
    """
    found = getattr(model, "ptr", model)
    if not isinstance(found, mujoco.MjModel):
        raise SceneError(f"model is {type(model).__name__}; valid is a compiled mujoco.MjModel, or dm_control's")
    if not 0 < found.opt.timestep <= _LONGEST_STEP:
        raise SceneError(
            f"the model's timestep is {found.opt.timestep:g} s; valid is a number greater than 0 and up to "
            f"{_LONGEST_STEP:g}, such as 0.002 (<option timestep=...>)"
        )
    for name in ("opt.gravity", "opt.wind", "body_pos", "body_quat", "body_mass", "geom_pos", "geom_size", "qpos0"):
        values = operator.attrgetter(name)(found)
        wrong = values[~(np.abs(values) <= mujoco.mjMAXVAL)]  # NaN, too
        if len(wrong):
            raise SceneError(f"the model's {name} holds {wrong[0]:g}; valid are numbers up to {mujoco.mjMAXVAL:g}")
    return found


def own_data(model: mujoco.MjModel, data: Any, *, drawn: bool = False) -> mujoco.MjData:
    """MuJoCo's data itself, also of dm_control's wrapper.

    Its model is `model`, whatever was changed there since, or a copy in which bodies move and collide alike. Where it
    is only `drawn`, they need not: shapes and places have to do. Raises `SceneError` if it is something else, or
    belongs to another model.
    """
    found = data if isinstance(data, mujoco.MjData) else getattr(data, "ptr", None)
    if not isinstance(found, mujoco.MjData):
        raise SceneError(f"data is {type(data).__name__}; valid is a mujoco.MjData, or dm_control's")
    other = found.model
    if other is model or other in _copies.get(model, ()):
        return found
    kinds = _SHAPES if drawn else _DYNAMICS
    if found.signature and model.signature:
        differing = "signature" if found.signature != model.signature else _differing(model, other, kinds)
    else:  # MuJoCo drops signatures in pickling, and gives the data a model of its own: then sizes have to do
        differing = "sizes" if _sizes(other) != _sizes(model) else None
    if differing:
        raise SceneError(
            f"data belongs to another model ({_sizes(other)}) than that of the ripples ({_sizes(model)}), of another "
            f"{differing}: give step the data of the latter, mujoco.MjData(model), or make new Ripples for the former"
        )
    if not drawn:
        _copies.setdefault(model, WeakSet()).add(other)
    return found


def check_targets(model: mujoco.MjModel, other: mujoco.MjModel, targets: Mapping[str, int]) -> None:
    """Make sure that targets, by name their geom ids in the `other` model, are those of a model that is to be drawn.

    Raises `SceneError` if any geom has another shape or place, or a target another name.
    """
    if model is other:
        return
    differing = _differing(model, other, _SHAPES)
    if differing is None and any(target_name(model, geom) != name for name, geom in targets.items()):
        differing = "names of geoms"
    if differing:
        raise SceneError(
            f"the ripples belong to another model ({_sizes(other)}) than the one to be drawn ({_sizes(model)}), of "
            f"another {differing}: draw ripples.model, or make new Ripples for the latter"
        )


def posed(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData:
    """The data, or where no poses were ever computed a copy with those of its `qpos`, as `mj_forward` computes them."""
    if data.xquat[0].any():  # that of the world
        return data
    data = copy.copy(data)
    for compute in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_flex):
        compute(model, data)
    return data


def _differing(model: mujoco.MjModel, other: mujoco.MjModel, kinds: tuple[str, ...]) -> str | None:
    """Name of the first array in which two models differ, of those whose names begin so."""
    names = (name for name in dir(model) if name.startswith(kinds) and not name.endswith(_LOOKS))
    return next((name for name in names if not np.array_equal(getattr(model, name), getattr(other, name))), None)


def _sizes(model: mujoco.MjModel) -> str:
    """What tells models apart: name, and how much they have of everything."""
    name = model.names.split(b"\0", 1)[0].decode()
    return ", ".join([repr(name), *(f"{size} {getattr(model, size)}" for size in _SIZES)])


def for_each(model: mujoco.MjModel, names: Iterable[str], what: str, value: Value | ByGeom[Value]) -> dict[str, Value]:
    """What an argument says for each target, by name: one value for all, or a mapping.

    Raises `SceneError` for a target that a mapping leaves out.
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


def to_body(model: mujoco.MjModel, geom: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points [..., 3] [m] of a target's atlas in the frame of the geom's body; soft targets are in the world."""
    if is_soft(model, geom):
        return points
    return points @ rotation_in_body(model, geom).T + model.geom_pos[geom]


def rotation_in_body(model: mujoco.MjModel, geom: int) -> NDArray[np.float64]:
    """Rotation [3, 3] of a geom in the frame of its body, with its axes as columns."""
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    return rotation.reshape(3, 3)


ENDLESS = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))


def named_collision_geoms(
    model: mujoco.MjModel, targets: Iterable[str], contacts: ByGeom[Sequence[GeomKey]]
) -> dict[int, tuple[int, ...]]:
    """Ids of the geoms that a user names to collide for targets, by the targets' ids.

    Raises
    ------
    SceneError
        For a geom that does not exist, on a body that moves by itself, or that ripples itself; and for contacts of a
        geom that does not ripple.
    """
    if not isinstance(contacts, Mapping):
        raise SceneError(f"contacts is {contacts!r}; valid is a mapping of rippling geoms to lists of geoms")
    rippling = {find_any(model, name): name for name in targets}
    found = {}
    for name, keys in by_name(model, contacts, "contacts").items():
        target = find_any(model, name)
        if is_soft(model, target):
            raise SceneError(
                f"contacts names {name!r}, a flex or a skin, for which no geoms can be chosen: a flex takes the "
                "contacts of its own vertices, a skin those of the bodies of its bones"
            )
        if target not in rippling:
            raise SceneError(
                f"contacts names geom {name!r}, which does not ripple; the rippling geoms are "
                f"{', '.join(map(repr, rippling.values())) or 'none'}"
            )
        if isinstance(keys, str) or not isinstance(keys, Iterable):
            raise SceneError(f"contacts of geom {name!r} is {keys!r}; valid is a list of geoms")
        found[target] = tuple(dict.fromkeys(find_geom(model, key) for key in keys))
        for geom in found[target]:
            other, weld = geom_name(model, geom), model.body_weldid[model.geom_bodyid]
            if weld[geom] != weld[target]:
                theirs, own = (model.body(model.geom_bodyid[each]).name for each in (geom, target))
                raise SceneError(
                    f"contacts of geom {name!r} names geom {other!r} on body {theirs!r}, which moves by itself; valid "
                    f"are geoms of body {own!r} and of those welded to it"
                )
            if geom != target and geom in rippling:
                raise SceneError(
                    f"contacts of geom {name!r} names geom {other!r}, which ripples itself and keeps its contacts; "
                    "take it out of one of the two"
                )
    return found


def find_collision_geoms(
    model: mujoco.MjModel, collides: NDArray[np.bool_], targets: Iterable[int], named: Mapping[int, Sequence[int]]
) -> dict[int, tuple[int, ...]]:
    """Geoms whose contacts load each target, by the target's geom id.

    Those that a target names, and itself where it collides. A target that does neither takes the geoms of its body that
    collide, but for planes, height fields, those that ripple themselves, and those that others name. Where there are
    none, or in the world, it takes those of bodies welded to its own; in the world, whose geoms need not belong
    together, only those whose middle lies in the box around the target.

    Parameters
    ----------
    model : mujoco.MjModel
    collides : bool [ngeom]
        Whether a geom collides.
    targets : iterable of int
        Geom ids.
    named : mapping
        Of some targets' ids to the ids that they name.
    """
    targets, weld = list(targets), model.body_weldid[model.geom_bodyid]
    free = collides & ~np.isin(model.geom_type, ENDLESS)
    free[[*targets, *(geom for geoms in named.values() for geom in geoms)]] = False
    found = {}
    for target in targets:
        own = (target,) if collides[target] else ()
        if own or target in named:
            found[target] = tuple(dict.fromkeys((*own, *named.get(target, ()))))
            continue
        body = model.geom_bodyid[target]
        kin = free & (model.geom_bodyid == body)
        if not (body and kin.any()):
            kin = free & (weld == weld[target])
            if not weld[target]:
                data = mujoco.MjData(model)
                mujoco.mj_kinematics(model, data)
                rotation, box = data.geom_xmat.reshape(-1, 3, 3), model.geom_aabb
                middles = data.geom_xpos + np.einsum("gij,gj->gi", rotation, box[:, :3])
                away = (middles - data.geom_xpos[target]) @ rotation[target] - box[target, :3]
                kin &= (np.abs(away) <= box[target, 3:]).all(axis=1)
        found[target] = tuple(np.flatnonzero(kin).tolist())
    return found
