"""The contacts on one target, geom by geom: what every later step reads."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints, kernel


class TargetContacts(NamedTuple):
    """All contacts that load one target in one step.

    Attributes
    ----------
    target : int
        Geom id.
    others : int64 [p]
        Ids of the geoms that touch it, ascending.
    begins : int64 [p + 1]
        The contacts with others[i] are those from begins[i] to begins[i + 1].
    points : float64 [k, 3]
        Contact points in the world [m], just outside the target's surface.
    forces : float64 [k]
        Normal forces [N], all positive.
    normals : float64 [k, 3]
        Unit normals in the world, from the target to the other geom.
    """

    target: int
    others: Ints
    begins: Ints
    points: Floats
    forces: Floats
    normals: Floats


class PairContacts(NamedTuple):
    """The contacts on all targets: as in `TargetContacts`, by (target, other) in ascending order."""

    targets: Ints
    others: Ints
    begins: Ints
    points: Floats
    forces: Floats
    normals: Floats

    def by_target(self) -> dict[int, TargetContacts]:
        """Split by target, in ascending order of their geom ids."""
        _, others, begins, points, forces, normals = self
        targets = self.targets.tolist()
        starts = [i for i, target in enumerate(targets) if i == 0 or target != targets[i - 1]]
        return {
            targets[a]: TargetContacts(targets[a], others[a:b], begins[a : b + 1], points, forces, normals)
            for a, b in pairwise([*starts, len(targets)])
        }


class Pairs(NamedTuple):
    """MuJoCo's contacts grouped by (target, other), in ascending order, and in MuJoCo's order within a pair.

    Attributes
    ----------
    targets, others : int64 [p]
        Geom ids.
    begins : int64 [p + 1]
        Pair i has the rows from begins[i] to begins[i + 1].
    contacts : int64 [k]
        Indices among MuJoCo's contacts. Where two targets touch, a contact is there for each of them.
    sides : int64 [k]
        0 where the target is the first geom of the contact, 1 where it is the second.
    """

    targets: Ints
    others: Ints
    begins: Ints
    contacts: Ints
    sides: Ints


@kernel
def group_by_pair(geoms: Ints, address: Ints, is_target: np.ndarray) -> Pairs:
    """Group the contacts that bear on targets.

    Parameters
    ----------
    geoms : int64 [ncon, 2]
        Geom ids, -1 for a flex that stands for no geom.
    address : int64 [ncon]
        Their rows in the constraint solver. A contact without one (excluded, or in the margin only) carries no force.
    is_target : bool [ngeom]
    """
    ngeom, count = len(is_target), 0
    keys, sources = np.empty(2 * len(geoms), np.int64), np.empty(2 * len(geoms), np.int64)
    for i in range(len(geoms)):
        if address[i] < 0 or geoms[i, 0] < 0 or geoms[i, 1] < 0:
            continue
        for side in range(2):
            if is_target[geoms[i, side]]:
                keys[count], sources[count] = geoms[i, side] * ngeom + geoms[i, 1 - side], 2 * i + side
                count += 1
    # a stable sort keeps the contacts of a pair in their order
    order = np.argsort(keys[:count], kind="mergesort")
    targets, others, begins = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count + 1, np.int64)
    contacts, sides = np.empty(count, np.int64), np.empty(count, np.int64)
    pairs, latest = 0, -1
    for j in range(count):
        if keys[order[j]] != latest:
            latest = keys[order[j]]
            targets[pairs], others[pairs] = divmod(latest, ngeom)
            begins[pairs] = j
            pairs += 1
        contacts[j], sides[j] = divmod(sources[order[j]], 2)
    begins[pairs] = count
    return Pairs(targets[:pairs], others[:pairs], begins[: pairs + 1], contacts, sides)
