"""A check that the contact forces of MuJoCo's constraint solver move bodies as they should."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from ripple_sim.solver.errors import warn_caller
from ripple_sim.solver.kernel import Floats

from .ids import TargetId
from .model import CoupledModel

# Share of the impulses on a target that may be missing from the bodies' motion, or be there without
# a contact force.
_TOLERANCE = 0.005

# The check looks at so many first steps in which a target is touched, and then at one step of so
# many.
_FIRST_LOOKS = 12
_LOOK_EVERY = 8
# It judges after this many looks, or when nothing touches the target any more.
_MIN_LOOKS = 4
# Factor by which all earlier looks count less with every new one.
_LOOK_FADING = 0.98

_PGS = int(mujoco.mjtSolver.mjSOL_PGS)

# Keeps a division by a squared force finite [N^2].
_MIN_SQUARED_FORCE = np.finfo(np.float64).tiny


class SolverBalance:
    """Compares reported contact forces with the accelerations of the bodies that they act on.

    MuJoCo's solvers CG and Newton look for the accelerations, and stop at an absolute tolerance
    that is set by the mean inertia of the whole model. Among very heavy bodies light ones may then
    be far from where their contact forces would take them: M a is not the sum of all forces. The
    missing force over the contact forces is the share by which the impulses given to a target are
    wrong. A warning is given once for each target.
    """

    def __init__(self, coupled: CoupledModel) -> None:
        model = coupled.model
        self._model = model
        self._names = coupled.names
        # kinematic tree of each collider; -1, the last row of arrays by tree, for colliders that do
        # not move and for vertices of flexes
        self._tree = np.full(len(coupled.owners), -1)
        self._tree[: model.ngeom] = model.body_treeid[model.geom_bodyid]
        # whether the root of a tree is a free body, whose first three degrees of freedom move the
        # tree as a whole
        root_joints = model.body_jntadr[model.tree_bodyadr]
        self._is_free = model.jnt_type[root_joints] == mujoco.mjtJoint.mjJNT_FREE
        self._warned = set[TargetId]()
        # for how many steps each target has been touched
        self._touched: dict[TargetId, int] = {}
        # of each target: number of looks, sum of contact forces [N], missing part of the forces [N]
        self._sums = {target: np.zeros(3) for target in range(model.ngeom)}

    def __call__(self, data: mujoco.MjData, contacts: Mapping[TargetId, Any]) -> None:
        """Warn of the targets whose forces and bodies disagree.

        Call it with the `Contacts` of each step, by target.
        """
        touched = [target for target in contacts if target < self._model.ngeom]
        for target in self._touched.keys() - touched:
            self._judge(target)
        self._touched = {target: self._touched.get(target, -1) + 1 for target in touched}
        due = []
        for target, steps in self._touched.items():
            if steps < _FIRST_LOOKS or steps % _LOOK_EVERY == 0:
                due.append(target)
        # PGS solves for the forces: the accelerations follow from them
        if not due or self._model.opt.solver == _PGS:
            return
        force_of_tree, share_of_tree = self._missing(data)
        for target in due:
            self._look(target, contacts[target], force_of_tree, share_of_tree)

    def _look(
        self, target: TargetId, contacts: Any, force_of_tree: Floats, share_of_tree: Floats
    ) -> None:
        """Add the forces of a step to the sums of a target, and judge them.

        Parameters
        ----------
        target : TargetId
        contacts : Contacts
            On the target.
        force_of_tree, share_of_tree : float64 [ntree + 1]
            See `_missing`.
        """
        others = contacts.others
        forces = np.abs(contacts.forces)
        trees = self._tree[[np.full_like(others, target), others]]
        starts = np.flatnonzero(np.diff(others, prepend=-1))
        amounts = np.add.reduceat(forces, starts)
        # of the two trees of a pair the one that misses less counts: a heavy body may hardly feel
        # the force that moves a light one
        at_free = force_of_tree[trees].min(axis=0)[starts]
        at_joints = share_of_tree[trees].min(axis=0)[starts] * amounts
        missing_at_joints = np.where(np.isfinite(at_joints), at_joints, 0.0)
        missing = np.where(np.isfinite(at_free), at_free, missing_at_joints)
        sums = self._sums[target]
        sums[1:] *= _LOOK_FADING
        sums += [1.0, amounts.sum(), missing.sum()]
        if sums[0] >= _MIN_LOOKS:
            self._judge(target)

    def _missing(self, data: mujoco.MjData) -> tuple[Floats, Floats]:
        """Missing force [N] of each free tree, and missing share of the other trees' forces.

        Both [ntree + 1], and infinite where the tree is not of that kind.
        """
        inertial_force = np.empty(self._model.nv)  # M a
        first = self._model.tree_dofadr
        mujoco.mj_mulM(self._model, data, inertial_force, data.qacc)
        missing = (inertial_force - data.qfrc_smooth - data.qfrc_constraint) ** 2
        constraint = np.add.reduceat(data.qfrc_constraint**2, first)
        squared_share = np.add.reduceat(missing, first) / np.maximum(constraint, _MIN_SQUARED_FORCE)
        share = np.sqrt(squared_share)
        force = np.full(len(first) + 1, np.inf)
        translations = first[self._is_free, None] + np.arange(3)
        force[:-1][self._is_free] = np.sqrt(missing[translations].sum(axis=1))
        return force, np.append(np.where(self._is_free, np.inf, share), np.inf)

    def _judge(self, target: TargetId) -> None:
        """Warn of a target if too much of its contact forces is missing."""
        _, force, missing = self._sums[target]
        if target in self._warned or missing <= _TOLERANCE * force:
            return
        self._warned.add(target)
        option = self._model.opt
        warn_caller(
            f"the impulses on geom {self._names[target]!r} are wrong by about "
            f"{missing / force:.1%}: MuJoCo's solver stopped before contact forces and "
            f"accelerations agreed, as happens where masses differ by many orders; set option "
            f"tolerance to 1e-14 or less (it is {option.tolerance:.2g}) and iterations to 1000 "
            f"(it is {option.iterations})"
        )
