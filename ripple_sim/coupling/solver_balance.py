"""A check that the contact forces of MuJoCo's constraint solver move bodies as they should."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Floats

from .model import CoupledModel

# Share of the impulses on a target that may be missing from the bodies' motion, or be there without
# a contact force.
_TOLERANCE = 0.005


# The solver is looked at in the first steps of a touch, and then in one of so many; it is judged
# after so many looks, or when nothing touches any more, by all looks so far, where old ones count
# less and less.
_FIRST_LOOKS = 12
_LOOK_EVERY = 8
_LOOKS = 4
_MEMORY = 0.98


_PGS = int(mujoco.mjtSolver.mjSOL_PGS)


_TINY = np.finfo(np.float64).tiny


class SolverBalance:
    """Compares reported contact forces with the accelerations of the bodies that they act on.

    MuJoCo's solvers CG and Newton look for the accelerations, and stop at an absolute tolerance
    that is set by the mean inertia of the whole model. Among very heavy bodies light ones may then
    be far from where their contact forces would take them: M a is not the sum of all forces. What
    is missing, over the contact forces, is the share by which the impulses given to a target are
    wrong. A warning is given once for each target.
    """

    def __init__(self, coupled: CoupledModel) -> None:
        self._model = coupled.model
        self._names = coupled.names
        model = coupled.model
        # tree of each collider: the last one, without degrees of freedom, for what does not move
        # and vertices of flexes
        self._tree = np.full(len(coupled.owners), -1)
        self._tree[: model.ngeom] = model.body_treeid[model.geom_bodyid]
        # a free body at the root: its first three degrees of freedom move the tree as a whole
        self._free = (
            model.jnt_type[model.body_jntadr[model.tree_bodyadr]] == mujoco.mjtJoint.mjJNT_FREE
        )
        self._warned = set[int]()
        # for how many steps each target has been touched; its looks, sum of contact forces [N], and
        # missing part [N]
        self._touched: dict[int, int] = {}
        self._sums = {target: np.zeros(3) for target in range(model.ngeom)}

    def __call__(self, data: mujoco.MjData, contacts: Mapping[int, Any]) -> None:
        """Warn of the targets whose forces and bodies disagree.

        Call it with the `Contacts` of each step, by target.
        """
        touched = [target for target in contacts if target < self._model.ngeom]
        for target in self._touched.keys() - touched:
            self._judge(target)
        self._touched = {target: self._touched.get(target, -1) + 1 for target in touched}
        watched = [
            t
            for t, steps in self._touched.items()
            if steps < _FIRST_LOOKS or steps % _LOOK_EVERY == 0
        ]
        # PGS looks for the forces: the accelerations follow from them
        if not watched or self._model.opt.solver == _PGS:
            return
        free, share = self._missing(data)
        for target in watched:
            others = contacts[target].others
            forces = np.abs(contacts[target].forces)
            trees = self._tree[[np.full_like(others, target), others]]
            # of a pair with a free body: a heavy one may hardly feel what moves a light one
            starts = np.flatnonzero(np.diff(others, prepend=-1))
            amounts = np.add.reduceat(forces, starts)
            at_free = free[trees].min(axis=0)[starts]
            at_joints = share[trees].min(axis=0)[starts] * amounts
            missing = np.where(
                np.isfinite(at_free), at_free, np.where(np.isfinite(at_joints), at_joints, 0.0)
            )
            sums = self._sums[target]
            sums[1:] *= _MEMORY
            sums += [1.0, amounts.sum(), missing.sum()]
            if sums[0] >= _LOOKS:
                self._judge(target)

    def _missing(self, data: mujoco.MjData) -> tuple[Floats, Floats]:
        """What is missing of each tree's motion, [ntree + 1]: the force [N] on a free body, the share of it at joints.

        Infinite where the tree is not of that kind.
        """
        moved = np.empty(self._model.nv)
        first = self._model.tree_dofadr
        mujoco.mj_mulM(self._model, data, moved, data.qacc)
        missing = (moved - data.qfrc_smooth - data.qfrc_constraint) ** 2
        constraint = np.add.reduceat(data.qfrc_constraint**2, first)
        share = np.sqrt(np.add.reduceat(missing, first) / np.maximum(constraint, _TINY))
        force = np.full(len(first) + 1, np.inf)
        force[:-1][self._free] = np.sqrt(
            missing[first[self._free, None] + np.arange(3)].sum(axis=1)
        )
        return force, np.append(np.where(self._free, np.inf, share), np.inf)

    def _judge(self, target: int) -> None:
        _, whole, missing = self._sums[target]
        if target in self._warned or missing <= _TOLERANCE * whole:
            return
        self._warned.add(target)
        option = self._model.opt
        warn_caller(
            f"the impulses on geom {self._names[target]!r} are wrong by about "
            f"{missing / whole:.1%}: MuJoCo's solver "
            f"stopped before contact forces and accelerations agreed, as happens where masses "
            f"differ by many orders; "
            f"set option tolerance to 1e-14 or less (it is {option.tolerance:.2g}) and iterations "
            f"to 1000 (it is "
            f"{option.iterations})"
        )
