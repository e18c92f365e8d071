"""Geoms of a MuJoCo model: their names, and which of them can ripple."""

from __future__ import annotations

import mujoco

from ripple_sim.errors import SceneError

TARGET_TYPES = {
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}")): name
    for name in ("mesh", "sdf", "sphere", "ellipsoid", "capsule", "cylinder", "box")
}


def geom_name(model: mujoco.MjModel, geom: int) -> str:
    """Name of a geom, or "geom <id>" where it has none."""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom) or f"geom {geom}"


def find_target(model: mujoco.MjModel, name: str) -> int:
    """Id of the geom that is to ripple.

    Raises
    ------
    SceneError
        If there is no such geom, or its type has no closed surface.
    """
    geom = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name)
    if geom < 0:
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, i) for i in range(model.ngeom)]
        known = ", ".join(repr(n) for n in names if n) or "none (give the geom a name in the MJCF)"
        raise SceneError(f"the model has no geom {name!r}; its named geoms are {known}")
    if int(model.geom_type[geom]) not in TARGET_TYPES:
        kind = mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
        raise SceneError(
            f"geom {name!r} is a {kind}, which cannot ripple; valid are {', '.join(TARGET_TYPES.values())}"
        )
    return geom
