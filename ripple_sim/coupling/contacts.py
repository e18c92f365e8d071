"""MuJoCo's contacts, target by target and body by body: normal forces and where they act."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import mujoco
import numba
import numpy as np
from numpy.typing import NDArray

_PYRAMIDAL = int(mujoco.mjtCone.mjCONE_PYRAMIDAL)


class Contacts(NamedTuple):
    """All contacts that press on one target in one step.

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
    others: NDArray[np.int64]
    begins: NDArray[np.int64]
    points: NDArray[np.float64]
    forces: NDArray[np.float64]
    normals: NDArray[np.float64]


def pressing_contacts(
    model: mujoco.MjModel, data: mujoco.MjData, is_target: NDArray[np.bool_], extents: NDArray[np.float64]
) -> dict[int, Contacts]:
    """Contacts that press on each target that is touched, by its geom id in ascending order.

    Where two targets touch, their contacts are reported for each of them.

    Parameters
    ----------
    model, data
    is_target : bool [ngeom]
        By geom id.
    extents : float64 [ngeom]
        Smallest half-extents [m]; see `smallest_extents`.
    """
    if not data.ncon:
        return {}
    contacts = data.contact
    forces = _normal_forces(contacts.efc_address, contacts.dim, data.efc_force, model.opt.cone == _PYRAMIDAL)
    starts, targets, others, begins, *at_contacts = _by_pair(
        contacts.geom, forces, contacts.frame, contacts.pos, contacts.dist, is_target, extents
    )
    return {
        target: Contacts(target, others[a:b], begins[a : b + 1], *at_contacts)
        for target, (a, b) in zip(targets.tolist(), pairwise(starts.tolist()), strict=True)
    }


def smallest_extents(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Smallest half-extent of every geom [m]; planes and height fields have none, and count as endless."""
    endless = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
    return np.where(np.isin(model.geom_type, endless), np.inf, model.geom_aabb[:, 3:].min(axis=1))


@numba.njit(cache=True, nogil=True)
def _normal_forces(address, dim, efc_force, pyramidal):
    """Normal force of every contact [N]."""
    forces = np.zeros(len(address))
    for i in range(len(address)):
        # without a row in the constraint solver (excluded, or in the margin only) a contact carries no force
        if address[i] >= 0:
            # the edges of a friction pyramid share the normal force among them
            rows = 2 * (dim[i] - 1) if pyramidal and dim[i] > 1 else 1
            forces[i] = efc_force[address[i] : address[i] + rows].sum()
    return forces


@numba.njit(cache=True, nogil=True)
def _by_pair(geoms, forces, frames, positions, dist, is_target, extents):
    """Targets in ascending order, pair by pair what touches them, and contact by contact how.

    Returned are the first pair of each target, the targets, the other geom and the first contact of each pair, and
    points, normal forces and normals of the contacts. `geoms` [ncon, 2] are the ids of what touches; the first three
    numbers of a frame are the normal that points from the first to the second.
    """
    count = 0
    pair, source = np.empty(2 * len(geoms), np.int64), np.empty(2 * len(geoms), np.int64)
    for i in range(len(geoms)):
        # a flex is no geom
        if forces[i] > 0 and geoms[i, 0] >= 0 and geoms[i, 1] >= 0:
            for side in range(2):
                target, other = geoms[i, side], geoms[i, 1 - side]
                if is_target[target]:
                    pair[count], source[count] = target * len(is_target) + other, 2 * i + side
                    count += 1
    # a sort that leaves the contacts of a pair in their order
    order = np.argsort(pair[:count], kind="mergesort")
    starts, targets = np.empty(count + 1, np.int64), np.empty(count, np.int64)
    others, begins = np.empty(count, np.int64), np.empty(count + 1, np.int64)
    points, loads, normals = np.empty((count, 3)), np.empty(count), np.empty((count, 3))
    found, pairs, latest = 0, 0, -1
    for row in range(count):
        if pair[order[row]] != latest:
            latest = pair[order[row]]
            target, others[pairs] = divmod(latest, len(is_target))
            begins[pairs] = row
            if found == 0 or target != targets[found - 1]:
                targets[found], starts[found] = target, pairs
                found += 1
            pairs += 1
        i, side = divmod(source[order[row]], 2)
        loads[row] = forces[i]
        # overlaps deeper than a body are none: MuJoCo's speculative contacts say by `dist` how hard to stop what comes
        depth = min(abs(dist[i]), extents[geoms[i, 0]], extents[geoms[i, 1]])
        for k in range(3):
            # MuJoCo's point lies half-way between the two surfaces, which overlap by -dist: the target's surface is
            # dist/2 away. Somewhat outside of it the nearest surface point is on this side, even of a thin part.
            normals[row, k] = -frames[i, k] if side else frames[i, k]
            points[row, k] = positions[i, k] + 1.5 * depth * normals[row, k]
    starts[found], begins[pairs] = pairs, count
    return starts[: found + 1], targets[:found], others[:pairs], begins[: pairs + 1], points, loads, normals
