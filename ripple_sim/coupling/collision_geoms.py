"""Geoms that collide instead of a target, as in models of robots."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError

from .geoms import ByGeom, GeomKey, by_name, find_any, find_geom, geom_name
from .ids import GeomId, TargetId, geom_id, is_geom

# Types of geoms without a size.
ENDLESS = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))


def named_collision_geoms(
    model: mujoco.MjModel, targets: Iterable[str], contacts: ByGeom[Sequence[GeomKey]]
) -> dict[GeomId, tuple[GeomId, ...]]:
    """Geoms that a user names to collide for targets, by target.

    Raises
    ------
    SceneError
        For a geom that does not exist, on a body that moves by itself, or that ripples itself; and
        for contacts of a geom that does not ripple.
    """
    if not isinstance(contacts, Mapping):
        raise SceneError(
            f"contacts must be a mapping of rippling geoms to lists of geoms, got {contacts!r}"
        )
    rippling: dict[TargetId, str] = {find_any(model, name): name for name in targets}
    solids_by_target: dict[GeomId, tuple[GeomId, ...]] = {}
    for name, keys in by_name(model, contacts, "contacts").items():
        target = find_any(model, name)
        if not is_geom(target, model):
            raise SceneError(
                f"contacts names {name!r}, a flex or a skin, for which no geoms can be chosen: a "
                "flex takes the contacts of its own vertices, a skin those of the bodies of its "
                "bones"
            )
        if target not in rippling:
            raise SceneError(
                f"contacts names geom {name!r}, which does not ripple; the rippling geoms are "
                f"{', '.join(map(repr, rippling.values())) or 'none'}"
            )
        if isinstance(keys, str) or not isinstance(keys, Iterable):
            raise SceneError(f"contacts of geom {name!r} must be a list of geoms, got {keys!r}")
        solids = tuple(dict.fromkeys(find_geom(model, key) for key in keys))
        for geom in solids:
            _check_named(model, target, name, geom)
            if geom != target and geom in rippling:
                raise SceneError(
                    f"contacts of geom {name!r} names geom {geom_name(model, geom)!r}, which "
                    "ripples itself and keeps its contacts; take it out of one of the two"
                )
        solids_by_target[target] = solids
    return solids_by_target


def _check_named(model: mujoco.MjModel, target: GeomId, name: str, geom: GeomId) -> None:
    """Refuse a geom on a body that moves against the target's body."""
    weld = model.body_weldid[model.geom_bodyid]
    if weld[geom] == weld[target]:
        return
    body = model.body(model.geom_bodyid[geom]).name
    own_body = model.body(model.geom_bodyid[target]).name
    raise SceneError(
        f"contacts of geom {name!r} must be geoms of body {own_body!r} and of bodies welded to "
        f"it, got geom {geom_name(model, geom)!r} on body {body!r}, which moves by itself"
    )


def find_collision_geoms(
    model: mujoco.MjModel,
    collides: NDArray[np.bool_],
    targets: Iterable[GeomId],
    named: Mapping[GeomId, Sequence[GeomId]],
) -> dict[GeomId, tuple[GeomId, ...]]:
    """Geoms whose contacts load each target, by target.

    A target is loaded by the geoms that it names, and by itself where it collides. A target that
    neither collides nor names geoms takes the colliding geoms of its body, except planes, height
    fields, geoms that ripple themselves, and geoms that other targets name. Where its body has no
    such geoms, or is the world, it takes those of bodies welded to its own. Geoms of the world need
    not belong together: there it takes only those whose middle lies in the box around the target.

    Parameters
    ----------
    model : mujoco.MjModel
    collides : bool [ngeom]
        Whether a geom collides.
    targets : iterable of GeomId
    named : mapping
        Of some targets to the geoms that they name.
    """
    targets = list(targets)
    # geoms that may collide for targets that name none
    free = collides & ~np.isin(model.geom_type, ENDLESS)
    free[targets] = False
    for geoms in named.values():
        free[list(geoms)] = False
    solids_by_target: dict[GeomId, tuple[GeomId, ...]] = {}
    for target in targets:
        solids = [*named.get(target, ())]
        if collides[target]:
            solids.insert(0, target)
        elif target not in named:
            related = _related(model, target, free)
            solids = [geom_id(geom) for geom in np.flatnonzero(related).tolist()]
        solids_by_target[target] = tuple(dict.fromkeys(solids))
    return solids_by_target


def _related(model: mujoco.MjModel, target: GeomId, free: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether each of the free geoms, [ngeom], collides for a target that names none."""
    body = model.geom_bodyid[target]
    on_body = free & (model.geom_bodyid == body)
    if body and on_body.any():
        return on_body
    weld = model.body_weldid[model.geom_bodyid]
    on_welded_bodies = free & (weld == weld[target])
    if weld[target]:
        return on_welded_bodies
    return on_welded_bodies & _in_box(model, target)


def _in_box(model: mujoco.MjModel, target: GeomId) -> NDArray[np.bool_]:
    """Whether the middles of geoms, [ngeom], lie in the box around a target."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rotation = data.geom_xmat.reshape(-1, 3, 3)
    box = model.geom_aabb
    middles = data.geom_xpos + np.einsum("gij,gj->gi", rotation, box[:, :3])
    # from the middle of the target's box, in the frame of the target [m]
    offsets = (middles - data.geom_xpos[target]) @ rotation[target] - box[target, :3]
    return (np.abs(offsets) <= box[target, 3:]).all(axis=1)
