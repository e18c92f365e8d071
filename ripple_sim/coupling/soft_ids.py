"""Ids and names of soft targets: flexes and skins come after geoms and the vertices of flexes; see `CoupledModel`."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray


def first_flex(model: mujoco.MjModel) -> int:
    """Target id of the first flex."""
    return int(model.ngeom + model.nflexvert)


def first_skin(model: mujoco.MjModel) -> int:
    """Target id of the first skin."""
    return first_flex(model) + int(model.nflex)


def is_soft(model: mujoco.MjModel, target: int) -> bool:
    """Whether a target is a flex or a skin, whose surface moves in the world, and not a geom."""
    return target >= model.ngeom


def target_pose(data: mujoco.MjData, target: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Position [3] [m] and rotation [3, 3] of a target's frame in the world, copies; what is soft is in the world."""
    if is_soft(data.model, target):
        return np.zeros(3), np.eye(3)
    return data.geom_xpos[target].copy(), data.geom_xmat[target].reshape(3, 3).copy()


def find_soft(model: mujoco.MjModel, name: object) -> int:
    """Target id of the flex or skin of a name, -1 if there is none."""
    if not isinstance(name, str) or not name:
        return -1
    for kind, first in ((mujoco.mjtObj.mjOBJ_FLEX, first_flex(model)), (mujoco.mjtObj.mjOBJ_SKIN, first_skin(model))):
        number = mujoco.mj_name2id(model, kind, name)
        if number >= 0:
            return first + int(number)
    return -1


def soft_name(model: mujoco.MjModel, target: int) -> str:
    """Name of a flex or a skin, or "flex <id>", "skin <id>"."""
    skin = target - first_skin(model)
    if skin >= 0:
        return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_SKIN, skin) or f"skin {skin}"
    flex = target - first_flex(model)
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex) or f"flex {flex}"


def soft_names(model: mujoco.MjModel) -> list[str]:
    """Names of all flexes, then of all skins."""
    return [soft_name(model, first_flex(model) + i) for i in range(model.nflex + model.nskin)]
