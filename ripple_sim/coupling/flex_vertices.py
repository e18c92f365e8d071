"""Soft flexes as colliders: each of their vertices touches for itself."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray


def flex_name(model: mujoco.MjModel, flex: int) -> str:
    """Name of a flex, or "flex <id>"."""
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_FLEX, flex) or f"flex {flex}"


def vertex_flexes(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Id of the flex of each vertex, [nflexvert]."""
    return np.repeat(np.arange(model.nflex), model.flex_vertnum)


def vertex_spacing(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Mean length of the edges of each vertex's flex [m], [nflexvert]."""
    spacing = [
        model.flexedge_length0[first : first + count].mean() if count else 0.0
        for first, count in zip(model.flex_edgeadr, model.flex_edgenum, strict=True)
    ]
    return np.array(spacing)[vertex_flexes(model)]
