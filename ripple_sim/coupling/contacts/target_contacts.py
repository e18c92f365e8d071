"""The contacts on one target, geom by geom: what every later step reads."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Bools, Floats, Ints, Ints32, kernel


class TargetContacts(NamedTuple):
    """All contacts that load one target in one step.

    Attributes
    ----------
    target : int
        Geom id.
    others : int64 [p]
        Collider ids of what touches it, ascending; see `CoupledModel`.
    begins : int64 [p + 1]
        The contacts with others[i] are those from begins[i] to begins[i + 1].
    points : float64 [k, 3]
        Contact points in the world [m], just outside the target's surface.
    forces : float64 [k]
        Normal forces [N]: positive, or all negative with a geom that sticks to the target and pulls.
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
    """The contacts on all targets, by (target, other) in ascending order; more as in `TargetContacts`.

    Attributes
    ----------
    targets : int64 [t]
        Geom ids.
    starts : int64 [t + 1]
        The pairs of targets[i] are those from starts[i] to starts[i + 1].
    """

    targets: Ints
    starts: Ints
    others: Ints
    begins: Ints
    points: Floats
    forces: Floats
    normals: Floats

    def by_target(self) -> dict[int, TargetContacts]:
        """Split by target, in ascending order of their geom ids."""
        targets, starts, others, begins, points, forces, normals = self
        return {
            target: TargetContacts(target, others[a:b], begins[a : b + 1], points, forces, normals)
            for target, (a, b) in zip(targets.tolist(), pairwise(starts.tolist()), strict=True)
        }


class Pairs(NamedTuple):
    """MuJoCo's contacts grouped by (target, other), in ascending order, and in MuJoCo's order within a pair.

    Attributes
    ----------
    targets, others : int64 [p]
        Collider ids.
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
def group_by_pair(colliders: Ints, address: Ints32, is_target: Bools) -> Pairs:
    """Group the contacts that bear on targets.

    Parameters
    ----------
    colliders : int64 [ncon, 2]
        Collider ids.
    address : int32 [ncon]
        Their rows in the constraint solver. A contact without one (excluded, or in the margin only) carries no force.
    is_target : bool [c]
    """
    size, count = len(is_target), 0
    keys, sources = np.empty(2 * len(colliders), np.int64), np.empty(2 * len(colliders), np.int64)
    for i in range(len(colliders)):
        if address[i] < 0:
            continue
        for side in range(2):
            if is_target[colliders[i, side]]:
                keys[count], sources[count] = colliders[i, side] * size + colliders[i, 1 - side], 2 * i + side
                count += 1
    # a stable sort keeps the contacts of a pair in their order
    order = np.argsort(keys[:count], kind="mergesort")
    targets, others, begins = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count + 1, np.int64)
    contacts, sides = np.empty(count, np.int64), np.empty(count, np.int64)
    pairs, latest = 0, -1
    for j in range(count):
        if keys[order[j]] != latest:
            latest = keys[order[j]]
            targets[pairs], others[pairs] = divmod(latest, size)
            begins[pairs] = j
            pairs += 1
        contacts[j], sides[j] = divmod(sources[order[j]], 2)
    begins[pairs] = count
    return Pairs(targets[:pairs], others[:pairs], begins[: pairs + 1], contacts, sides)


@kernel
def room_for(pairs: Pairs) -> PairContacts:
    """Arrays for the contacts of all pairs, with a target for each pair."""
    p, k = len(pairs.targets), len(pairs.contacts)
    targets, starts, others = np.empty(p, np.int64), np.empty(p + 1, np.int64), np.empty(p, np.int64)
    return PairContacts(
        targets, starts, others, np.empty(p + 1, np.int64), np.empty((k, 3)), np.empty(k), np.empty((k, 3))
    )


@kernel
def trimmed(room: PairContacts, pairs: int, contacts: int) -> PairContacts:
    """The first pairs and contacts that were written to the arrays, with one entry for each target."""
    targets, starts, begins, count = room.targets, room.starts, room.begins, 0
    for pair in range(pairs):
        if count == 0 or targets[pair] != targets[count - 1]:
            targets[count], starts[count] = targets[pair], pair
            count += 1
    starts[count], begins[pairs] = pairs, contacts
    return PairContacts(
        targets[:count],
        starts[: count + 1],
        room.others[:pairs],
        begins[: pairs + 1],
        room.points[:contacts],
        room.forces[:contacts],
        room.normals[:contacts],
    )
