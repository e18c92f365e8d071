"""The contacts on one target, geom by geom: what every later step reads.

MuJoCo's contacts between geoms: normal forces, and where they act on each target.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import mujoco
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


PYRAMIDAL = int(mujoco.mjtCone.mjCONE_PYRAMIDAL)


class _MujocoContacts(NamedTuple):
    """MuJoCo's arrays of contacts, of the same names, forces of its constraint solver, and pulls; see `Adhesion`."""

    efc_address: Ints32
    dim: Ints32
    frame: Floats
    pos: Floats
    dist: Floats
    efc_force: Floats
    pulls: Floats


def geom_contacts(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    colliders: NDArray[np.int64],
    is_target: NDArray[np.bool_],
    extents: NDArray[np.float64],
    pulls: NDArray[np.float64] | None = None,
    has_flex: NDArray[np.bool_] | None = None,
) -> dict[int, TargetContacts]:
    """Contacts that load each target that is touched, by its geom id in ascending order.

    Where two targets touch, their contacts are reported for each of them. What sticks to a target and pulls more than
    it pushes has negative forces, at all contacts of the pair.

    Parameters
    ----------
    model, data
    colliders : int64 [ncon, 2]
        Collider ids of each contact, see `CoupledModel`.
    is_target : bool [c]
        By collider id.
    extents : float64 [c]
        Smallest half-extents [m].
    pulls : float64 [ncon], optional
        Of the contacts [N]; see `Adhesion`.
    has_flex : bool [c], optional
        By collider id, whether it collides through a flex. Its triangles push sideways in pairs: the contacts of such a
        pair add up to the sum of their vectors, as for the flex; see `FlexContacts`.
    """
    if not data.ncon:
        return {}
    each = data.contact
    pulls = np.zeros(data.ncon) if pulls is None else pulls
    fields = (each.efc_address, each.dim, each.frame, each.pos, each.dist, data.efc_force, pulls)
    contacts = _MujocoContacts(*contiguous(*fields))
    has_flex = np.zeros(len(is_target), dtype=np.bool_) if has_flex is None else has_flex
    pyramidal = model.opt.cone == PYRAMIDAL
    return trimmed(*_normal_contacts(colliders, contacts, is_target, has_flex, extents, pyramidal)).by_target()


@kernel
def _normal_contacts(
    colliders: Ints, contacts: _MujocoContacts, is_target: Bools, has_flex: Bools, extents: Floats, pyramidal: bool
) -> tuple[PairContacts, tuple[int, int, int]]:
    """Contacts that push or pull, and how many; pairs without one are left out."""
    address = contacts.efc_address.copy()
    for i in range(len(address)):
        # those within the gap pull without a row in the constraint solver
        if contacts.pulls[i] > 0:
            address[i] = 0
    pairs = group_by_pair(colliders, address, is_target)
    found, found_pairs, row = room_for(pairs), 0, 0
    for pair in range(len(pairs.targets)):
        first, pull, whole = row, 0.0, 0.0
        for j in range(pairs.begins[pair], pairs.begins[pair + 1]):
            i, frame = pairs.contacts[j], contacts.frame
            force = _normal_force(contacts, i, pyramidal) + contacts.pulls[i]
            if not force > 0:
                continue
            found.forces[row] = force
            pull, whole = pull + 2 * contacts.pulls[i], whole + force
            # an overlap deeper than a geom is not real: a speculative contact's `dist` only says how hard to stop
            depth = min(abs(contacts.dist[i]), extents[pairs.targets[pair]], extents[pairs.others[pair]])
            for k in range(3):
                # MuJoCo's point lies half-way between the two surfaces, which overlap by -dist: the target's surface is
                # dist/2 away. A little outside it the nearest surface point is on this side, even of a thin part.
                normal = -frame[i, k] if pairs.sides[j] else frame[i, k]
                found.normals[row, k] = normal
                found.points[row, k] = contacts.pos[i, k] + 1.5 * depth * normal
            row += 1
        if pull > 0:
            # the pair's own force, shared among its contacts by how much they bear
            _multiply(found.forces, first, row, (whole - pull) / whole)
        if has_flex[pairs.others[pair]] and row > first and pull != whole:
            _multiply(found.forces, first, row, _unity(found.forces, found.normals, first, row))
        if row > first and pull != whole:
            found.targets[found_pairs], found.others[found_pairs] = pairs.targets[pair], pairs.others[pair]
            found.begins[found_pairs] = first
            found_pairs += 1
        else:
            row = first
    return found, close(found, found_pairs, row)


@kernel
def _multiply(forces: Floats, first: int, last: int, factor: float) -> None:
    """Multiply the forces from `first` to `last`."""
    for i in range(first, last):
        forces[i] *= factor


@kernel
def _unity(forces: Floats, normals: Floats, first: int, last: int) -> float:
    """Amount of the sum of forces from `first` to `last` along normals, over the sum of their amounts."""
    whole, square = 0.0, 0.0
    for i in range(first, last):
        whole += forces[i]
    for k in range(3):
        along = 0.0
        for i in range(first, last):
            along += forces[i] * normals[i, k]
        square += along**2
    return np.sqrt(square) / abs(whole)


@kernel
def _normal_force(contacts: _MujocoContacts, i: int, pyramidal: bool) -> float:
    """Normal force of a contact [N]."""
    address, dim, force = contacts.efc_address[i], contacts.dim[i], 0.0
    if address < 0:
        return force
    # the edges of a friction pyramid share the normal force among them
    for edge in range(2 * (dim - 1) if pyramidal and dim > 1 else 1):
        force += contacts.efc_force[address + edge]
    return force
