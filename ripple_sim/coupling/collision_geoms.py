"""Geoms that collide in place of a target, as models of robots have them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import SceneError

from .geoms import ByGeom, GeomKey, by_name, find_any, find_geom, geom_name
from .soft import is_soft

ENDLESS = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))


def named_collision_geoms(
    model: mujoco.MjModel, targets: Iterable[str], contacts: ByGeom[Sequence[GeomKey]]
) -> dict[int, tuple[int, ...]]:
    """Ids of the geoms that a user names to collide for targets, by the targets' ids.

    Raises
    ------
    SceneError
        For a geom that does not exist, on a body that moves by itself, or that ripples itself; and
        for contacts of a geom that does not ripple.
    """
    if not isinstance(contacts, Mapping):
        raise SceneError(
            f"contacts is {contacts!r}; valid is a mapping of rippling geoms to lists of geoms"
        )
    rippling = {find_any(model, name): name for name in targets}
    found = {}
    for name, keys in by_name(model, contacts, "contacts").items():
        target = find_any(model, name)
        if is_soft(model, target):
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
            raise SceneError(f"contacts of geom {name!r} is {keys!r}; valid is a list of geoms")
        found[target] = tuple(dict.fromkeys(find_geom(model, key) for key in keys))
        for geom in found[target]:
            other = geom_name(model, geom)
            weld = model.body_weldid[model.geom_bodyid]
            if weld[geom] != weld[target]:
                theirs, own = (model.body(model.geom_bodyid[each]).name for each in (geom, target))
                raise SceneError(
                    f"contacts of geom {name!r} names geom {other!r} on body {theirs!r}, which "
                    f"moves by itself; valid are geoms of body {own!r} and of those welded to it"
                )
            if geom != target and geom in rippling:
                raise SceneError(
                    f"contacts of geom {name!r} names geom {other!r}, which ripples itself and "
                    "keeps its contacts; take it out of one of the two"
                )
    return found


def find_collision_geoms(
    model: mujoco.MjModel,
    collides: NDArray[np.bool_],
    targets: Iterable[int],
    named: Mapping[int, Sequence[int]],
) -> dict[int, tuple[int, ...]]:
    """Geoms whose contacts load each target, by the target's geom id.

    Those that a target names, and itself where it collides. A target that does neither takes the
    geoms of its body that collide, but for planes, height fields, those that ripple themselves, and
    those that others name. Where there are none, or in the world, it takes those of bodies welded
    to its own; in the world, whose geoms need not belong together, only those whose middle lies in
    the box around the target.

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
    targets = list(targets)
    weld = model.body_weldid[model.geom_bodyid]
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
                rotation = data.geom_xmat.reshape(-1, 3, 3)
                box = model.geom_aabb
                middles = data.geom_xpos + np.einsum("gij,gj->gi", rotation, box[:, :3])
                away = (middles - data.geom_xpos[target]) @ rotation[target] - box[target, :3]
                kin &= (np.abs(away) <= box[target, 3:]).all(axis=1)
        found[target] = tuple(np.flatnonzero(kin).tolist())
    return found
