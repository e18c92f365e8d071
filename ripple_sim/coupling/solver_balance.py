"""A check of MuJoCo's constraint solver: whether the contact forces that it reports move bodies as they should."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from ripple_sim.errors import RippleWarning
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel

from .contacts import TargetContacts
from .model import CoupledModel

_PGS = int(mujoco.mjtSolver.mjSOL_PGS)
_TINY = np.finfo(np.float64).tiny

# Share of the impulses on a target that may be missing from the bodies' motion, or be there without a contact force.
_TOLERANCE = 0.005
# The check looks at the first steps of a touch, and then at one in so many; it judges after so many looks, or when
# nothing touches any more, by all looks so far, where old ones count less and less.
_FIRST, _EVERY, _LOOKS, _MEMORY = 12, 8, 4, 0.98


class _Trees(NamedTuple):
    """Kinematic trees of a model.

    Attributes
    ----------
    of_collider : int64 [c]
        Tree of each collider, see `CoupledModel`: -1 for geoms that do not move, and for vertices of flexes.
    starts : int64 [ntree + 1]
        The degrees of freedom of tree i are those from starts[i] to starts[i + 1].
    free : bool [ntree]
        Whether the root is a free body: its first three degrees of freedom move the tree as a whole.
    """

    of_collider: Ints
    starts: Ints
    free: Bools


class SolverBalance:
    """Compares reported contact forces with the accelerations of the bodies that they act on.

    MuJoCo's solvers CG and Newton look for the accelerations, and stop at an absolute tolerance that is set by the mean
    inertia of the whole model. Among very heavy bodies light ones may then be far from where their contact forces would
    take them: M a is not the sum of all forces. What is missing, over the contact forces, is the share by which the
    impulses given to a target are wrong. A warning is given once for each target.

    Parameters
    ----------
    coupled : CoupledModel
    """

    def __init__(self, coupled: CoupledModel) -> None:
        self._model, self._names, model = coupled.model, coupled.names, coupled.model
        roots = model.body_jntadr[model.tree_bodyadr]
        of_collider = np.full(len(coupled.owners), -1)
        of_collider[: model.ngeom] = model.body_treeid[model.geom_bodyid]
        self._trees = _Trees(
            of_collider,
            np.append(model.tree_dofadr, model.nv).astype(np.int64),
            model.jnt_type[roots] == mujoco.mjtJoint.mjJNT_FREE,
        )
        self._warned = set[int]()
        # for how many steps each target has been touched; its looks, sum of contact forces [N], and missing part [N]
        self._touched: dict[int, int] = {}
        self._sums = {target: np.zeros(3) for target in range(model.ngeom)}

    def __call__(self, data: mujoco.MjData, contacts: Mapping[int, TargetContacts]) -> None:
        """Warn of the targets whose contact forces and bodies disagree. Call it with the contacts of each step."""
        contacts = {target: each for target, each in contacts.items() if target < self._model.ngeom}
        for target in self._touched.keys() - contacts.keys():
            self._judge(target)
        self._touched = {target: self._touched.get(target, -1) + 1 for target in contacts}
        watched = [t for t, steps in self._touched.items() if steps < _FIRST or steps % _EVERY == 0]
        # PGS looks for the forces: the accelerations follow from them
        if not watched or self._model.opt.solver == _PGS:
            return
        moved = np.empty(self._model.nv)
        mujoco.mj_mulM(self._model, data, moved, data.qacc)
        missing = moved - data.qfrc_smooth - data.qfrc_constraint
        for target in watched:
            sums = self._sums[target]
            sums[1:] *= _MEMORY
            sums += [1.0, *_missing(contacts[target], self._trees, missing, data.qfrc_constraint)]
            if sums[0] >= _LOOKS:
                self._judge(target)

    def _judge(self, target: int) -> None:
        _, whole, missing = self._sums[target]
        if target in self._warned or missing <= _TOLERANCE * whole:
            return
        self._warned.add(target)
        option = self._model.opt
        warnings.warn(
            f"the impulses on geom {self._names[target]!r} are wrong by about {missing / whole:.1%}: MuJoCo's solver "
            f"stopped before contact forces and accelerations agreed, as happens where masses differ by many orders; "
            f"set option tolerance to 1e-14 or less (it is {option.tolerance:.2g}) and iterations to 1000 (it is "
            f"{option.iterations})",
            RippleWarning,
            stacklevel=6,
        )


@kernel
def _missing(contacts: TargetContacts, trees: _Trees, missing: Floats, constraint: Floats) -> tuple[float, float]:
    """Sum of the forces of contacts [N], and the part of it that shows in neither body's motion [N]."""
    total, unseen = 0.0, 0.0
    for i in range(len(contacts.others)):
        force = 0.0
        for k in range(contacts.begins[i], contacts.begins[i + 1]):
            force += abs(contacts.forces[k])
        one, other = trees.of_collider[contacts.target], trees.of_collider[contacts.others[i]]
        at_free, at_joints = np.inf, np.inf
        for tree in (one, other):
            if tree < 0:
                continue
            first, last = trees.starts[tree], trees.starts[tree + 1]
            if trees.free[tree]:
                # a heavy body may hardly feel what moves a light one
                at_free = min(at_free, np.sqrt(_square(missing, first, first + 3)))
            else:
                share = np.sqrt(_square(missing, first, last) / max(_square(constraint, first, last), _TINY))
                at_joints = min(at_joints, share * force)
        total += force
        unseen += at_free if np.isfinite(at_free) else at_joints if np.isfinite(at_joints) else 0.0
    return total, unseen


@kernel
def _square(values: Floats, first: int, last: int) -> float:
    """Sum of the squares of the values from `first` to `last`."""
    total = 0.0
    for i in range(first, last):
        total += values[i] ** 2
    return total
