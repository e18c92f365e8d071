"""The contacts on one target, geom by geom: what every later step reads."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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


def contiguous(*fields: NDArray) -> Iterator[NDArray]:
    """Arrays of MuJoCo's contacts as kernels take them.

    One contact alone is an array of another layout than several: kernels would be compiled for each.
    """
    return map(np.ascontiguousarray, fields)


@kernel
def group_by_pair(colliders: Ints, address: Ints32, is_target: Bools) -> Pairs:
    """Group the contacts that bear on targets.

    Parameters
    ----------
    colliders : int64 [ncon, 2]
        Collider ids, -1 for what is none.
    address : int32 [ncon]
        Their rows in the constraint solver. A contact without one (excluded, or in the margin only) carries no force.
    is_target : bool [c]
    """
    count = 0
    for i in range(len(colliders)):
        for side in range(2):
            if _bears(colliders, address, is_target, i, side):
                count += 1
    order = np.empty(count, np.int64)
    count = 0
    for i in range(len(colliders)):
        for side in range(2):
            if _bears(colliders, address, is_target, i, side):
                order[count] = 2 * i + side
                count += 1
    order = _sorted_by(_sorted_by(order, colliders, 1, len(is_target)), colliders, 0, len(is_target))
    pairs = 0
    for j in range(count):
        if j == 0 or not _same_pair(order[j - 1], order[j], colliders):
            pairs += 1
    targets, others, begins = np.empty(pairs, np.int64), np.empty(pairs, np.int64), np.empty(pairs + 1, np.int64)
    contacts, sides = np.empty(count, np.int64), np.empty(count, np.int64)
    pairs = 0
    for j in range(count):
        contacts[j], sides[j] = order[j] // 2, order[j] % 2
        if j == 0 or not _same_pair(order[j - 1], order[j], colliders):
            targets[pairs], others[pairs] = _collider(order[j], colliders, 0), _collider(order[j], colliders, 1)
            begins[pairs] = j
            pairs += 1
    begins[pairs] = count
    return Pairs(targets, others, begins, contacts, sides)


# In these kernels there are loops only: slices, sorts and expressions of arrays take many times longer to compile.
@kernel
def _bears(colliders: Ints, address: Ints32, is_target: Bools, i: int, side: int) -> bool:
    """Whether contact i bears on the target that is its side."""
    return address[i] >= 0 and min(colliders[i, 0], colliders[i, 1]) >= 0 and is_target[colliders[i, side]]


@kernel
def _collider(source: int, colliders: Ints, role: int) -> int:
    """Target, role 0, or other, 1, of a contact i as seen from a side: source 2 i + side."""
    return colliders[source // 2, (source + role) % 2]


@kernel
def _same_pair(one: int, two: int, colliders: Ints) -> bool:
    """Whether two sources have the same target and other."""
    targets_agree = _collider(one, colliders, 0) == _collider(two, colliders, 0)
    return targets_agree and _collider(one, colliders, 1) == _collider(two, colliders, 1)


@kernel
def _sorted_by(sources: Ints, colliders: Ints, role: int, size: int) -> Ints:
    """Sources sorted by their colliders in a role, by counting: those with the same one stay in their order."""
    starts, found = np.zeros(size + 1, np.int64), np.empty(len(sources), np.int64)
    for j in range(len(sources)):
        starts[_collider(sources[j], colliders, role) + 1] += 1
    for i in range(size):
        starts[i + 1] += starts[i]
    for j in range(len(sources)):
        collider = _collider(sources[j], colliders, role)
        found[starts[collider]] = sources[j]
        starts[collider] += 1
    return found


@kernel
def room_for(pairs: Pairs) -> PairContacts:
    """Arrays for the contacts of all pairs, with a target for each pair."""
    p, k = len(pairs.targets), len(pairs.contacts)
    targets, starts, others = np.empty(p, np.int64), np.empty(p + 1, np.int64), np.empty(p, np.int64)
    return PairContacts(
        targets, starts, others, np.empty(p + 1, np.int64), np.empty((k, 3)), np.empty(k), np.empty((k, 3))
    )


@kernel
def close(room: PairContacts, pairs: int, contacts: int) -> tuple[int, int, int]:
    """Sum up the first pairs and contacts that were written to the arrays; how many targets they have, and they are."""
    targets, count = room.targets, 0
    for pair in range(pairs):
        if count == 0 or targets[pair] != targets[count - 1]:
            targets[count], room.starts[count] = targets[pair], pair
            count += 1
    room.starts[count], room.begins[pairs] = pairs, contacts
    return count, pairs, contacts


def trimmed(room: PairContacts, counts: tuple[int, int, int]) -> PairContacts:
    """Arrays that were closed, cut to what is in them."""
    targets, pairs, contacts = counts
    return PairContacts(
        room.targets[:targets],
        room.starts[: targets + 1],
        room.others[:pairs],
        room.begins[: pairs + 1],
        room.points[:contacts],
        room.forces[:contacts],
        room.normals[:contacts],
    )
