"""Convex colliders: geoms that collide as the convex parts of a mesh geom, in its place."""

from __future__ import annotations

import mujoco
import numpy as np

_VISIBLE = (int(mujoco.mjtGeom.mjGEOM_MESH), int(mujoco.mjtGeom.mjGEOM_SDF))


def part_name(geom: str, index: int) -> str:
    """Name of a convex part of a geom: of its collider, and of that one's mesh."""
    return f"{geom}#{index}"


def find_convex_colliders(model: mujoco.MjModel) -> dict[int, list[int]]:
    """Convex colliders by the id of their geom, which does not collide itself.

    They are mesh geoms on its body, called by its name, "#" and a number.
    """
    found: dict[int, list[int]] = {}
    for part in np.flatnonzero(model.geom_type == _VISIBLE[0]).tolist():
        name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, part) or ""
        whole, mark, number = name.rpartition("#")
        geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, whole) if mark and number.isdecimal() else -1
        if geom < 0 or model.geom_type[geom] not in _VISIBLE or model.geom_bodyid[geom] != model.geom_bodyid[part]:
            continue
        if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            found.setdefault(geom, []).append(part)
    return found
