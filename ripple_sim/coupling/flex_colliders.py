"""Flex colliders: rigid flexes through which mesh geoms collide."""

from __future__ import annotations

import mujoco


def find_flex_colliders(model: mujoco.MjModel) -> dict[int, int]:
    """Flex that collides in place of a geom, by geom id: a rigid one of triangles, of its name and on its body."""
    found = {}
    for flex in range(model.nflex):
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex)
        geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) if name else -1
        if geom < 0 or model.flex_dim[flex] != 2 or not model.flex_rigid[flex]:
            continue
        if model.flex_vertbodyid[model.flex_vertadr[flex]] == model.geom_bodyid[geom]:
            found[geom] = flex
    return found


def flex_thickness(model: mujoco.MjModel, flex: int) -> float:
    """Distance from its triangles at which a flex holds other geoms off [m]."""
    return float(model.flex_margin[flex] + model.flex_radius[flex])
