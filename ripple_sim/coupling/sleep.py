"""MuJoCo's sleep: the contacts of bodies that sleep, and how to wake bodies.

MuJoCo stops the bodies of an island that were slow for some steps, and leaves out their contacts.
It does not know that a rippling surface below them may move.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable

import mujoco
import numpy as np

from ripple_sim.solver.kernel import Bools

SLEEP = int(mujoco.mjtEnableBit.mjENBL_SLEEP)
_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)

# Velocity that wakes a sleeping tree and moves nothing [m/s or rad/s]: MuJoCo wakes every tree
# that has a velocity.
_WAKING_VELOCITY = 1e-200

# Parameters of contacts whose forces are those of statics, however deep the bodies have sunk into
# each other: a `solref` without a spring (time constant [s] and damping ratio), and a `solimp` with
# an impedance of nearly 1.
_SOLREF_WITHOUT_SPRING = (1e6, 1.0)
_SOLIMP_RIGID = (0.9999, 0.9999, 0.001, 0.5, 2.0)
# Geoms that are apart by less than this share of the size of the smaller one touch.
_MAX_GAP_SHARE = 1e-3


def at_rest(model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData | None:
    """Data with the contacts of all bodies where they lie, all awake and without velocity.

    None where no body sleeps.
    """
    if (data.tree_asleep < 0).all():
        return None
    still = copy.copy(model)
    still.opt.enableflags &= ~SLEEP
    for kind in ("geom", "pair", "flex"):
        getattr(still, f"{kind}_solref")[:] = _SOLREF_WITHOUT_SPRING
        getattr(still, f"{kind}_solimp")[:] = _SOLIMP_RIGID
    # a plane, which has no end, has a bounding radius of 0
    sizes = np.minimum(still.geom_aabb[:, 3:].min(axis=1), still.geom_rbound)
    still.geom_margin += _MAX_GAP_SHARE * sizes
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)
    resting = mujoco.MjData(still)
    mujoco.mj_setState(still, resting, state, _STATE)
    resting.qvel[:] = 0.0
    resting.qacc_warmstart[:] = 0.0
    mujoco.mj_forward(still, resting)
    return resting


def sleeping_dofs(model: mujoco.MjModel, data: mujoco.MjData) -> Bools:
    """Whether each degree of freedom belongs to a tree that sleeps, [nv]."""
    if not model.opt.enableflags & SLEEP:
        return np.zeros(model.nv, dtype=np.bool_)
    return np.asarray(data.tree_asleep[model.dof_treeid] >= 0)


def wake(model: mujoco.MjModel, data: mujoco.MjData, bodies: Iterable[int]) -> None:
    """Wake bodies in the coming step, and with them all bodies that fell asleep together."""
    for body in bodies:
        tree = int(model.body_treeid[body])
        if tree >= 0 and data.tree_asleep[tree] >= 0:
            data.qvel[model.tree_dofadr[tree]] = _WAKING_VELOCITY
