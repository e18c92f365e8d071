"""The contacts of bodies that sleep from the beginning, as MuJoCo would find them if it held the bodies still."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

_SLEEP, _STATE = int(mujoco.mjtEnableBit.mjENBL_SLEEP), int(mujoco.mjtState.mjSTATE_INTEGRATION)

# Contacts of these parameters have no spring, and a share of nearly 1 in what holds bodies: their forces are those of
# statics, however deep the bodies lie in each other.
_NO_SPRING, _RIGID = (1e6, 1.0), (0.9999, 0.9999, 0.001, 0.5, 2.0)
# Geoms that are apart by this share of the smaller one's size are meant to touch.
_NEAR = 1e-3


def at_rest(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData | None:
    """Data with the contacts of all bodies as they lie, all awake and at rest; None where none of them sleeps."""
    if not model.opt.enableflags & _SLEEP or (data.tree_asleep < 0).all():
        return None
    still = copy.copy(model)
    still.opt.enableflags &= ~_SLEEP
    for kind in ("geom", "pair", "flex"):
        getattr(still, f"{kind}_solref")[:] = _NO_SPRING
        getattr(still, f"{kind}_solimp")[:] = _RIGID
    # planes, which have no end, are given a radius of 0
    still.geom_margin += _NEAR * np.minimum(still.geom_aabb[:, 3:].min(axis=1), still.geom_rbound)
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)
    resting = mujoco.MjData(still)
    mujoco.mj_setState(still, resting, state, _STATE)
    resting.qvel[:], resting.qacc_warmstart[:] = 0.0, 0.0
    mujoco.mj_forward(still, resting)
    return resting
