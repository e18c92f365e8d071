"""Ids of geoms, flexes, targets and colliders: whole numbers, with a type for each numbering.

Geoms, flexes and skins have MuJoCo's ids. A collider is anything that can touch. There are c of
them, in this order:

    0                    the geoms, by their own ids
    ngeom                the vertices of all flexes, flex by flex
    ngeom + nflexvert    the flexes as wholes, then the skins as wholes

A target is a geom, a flex or a skin as a whole, and its target id is its collider id. So each geom
id is a target id, and each target id a collider id, but not the other way around; the types say the
same, and a type checker finds a mix-up.
"""

from __future__ import annotations

from typing import NewType, TypeGuard

import mujoco

ColliderId = NewType("ColliderId", int)
TargetId = NewType("TargetId", ColliderId)
GeomId = NewType("GeomId", TargetId)
FlexId = NewType("FlexId", int)
SkinId = NewType("SkinId", int)


def geom_id(number: int) -> GeomId:
    """A whole number that is known to be the id of a geom."""
    return GeomId(TargetId(ColliderId(number)))


def is_geom(collider: ColliderId, model: mujoco.MjModel) -> TypeGuard[GeomId]:
    """Whether a collider or a target is a geom, and no flex, skin or vertex."""
    return collider < model.ngeom


def target_of_flex(model: mujoco.MjModel, flex: int) -> TargetId:
    """Target id of a flex."""
    return TargetId(ColliderId(int(model.ngeom + model.nflexvert) + flex))


def target_of_skin(model: mujoco.MjModel, skin: int) -> TargetId:
    """Target id of a skin."""
    return target_of_flex(model, int(model.nflex) + skin)


def flex_of(model: mujoco.MjModel, target: TargetId) -> FlexId:
    """Flex id of a target, -1 if it is no flex."""
    flex = target - target_of_flex(model, 0)
    return FlexId(flex if 0 <= flex < model.nflex else -1)


def skin_of(model: mujoco.MjModel, target: TargetId) -> SkinId:
    """Skin id of a target, -1 if it is no skin."""
    return SkinId(max(target - target_of_skin(model, 0), -1))
