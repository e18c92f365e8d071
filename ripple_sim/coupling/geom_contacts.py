"""MuJoCo's contacts between geoms: normal forces, and where they act on each target."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Bools, Floats, Ints, Ints32, kernel

from .contacts import PairContacts, TargetContacts, close, contiguous, group_by_pair, room_for, trimmed

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
