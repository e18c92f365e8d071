"""MuJoCo's contacts, target by target and body by body: normal forces and where they act."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import mujoco
import numba
import numpy as np
from numpy.typing import NDArray

PYRAMIDAL = int(mujoco.mjtCone.mjCONE_PYRAMIDAL)


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
    model: mujoco.MjModel,
    data: mujoco.MjData,
    is_target: NDArray[np.bool_],
    extents: NDArray[np.float64],
    geoms: NDArray[np.int64] | None = None,
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
    geoms : int [ncon, 2]
        What touches, by geom id, where that is not what MuJoCo says.
    """
    if not data.ncon:
        return {}
    contacts = data.contact
    geoms, address = contacts.geom if geoms is None else geoms, contacts.efc_address
    rows = _on_targets(geoms, address, is_target)
    if not len(rows):
        return {}
    forces = _normal_forces(rows, address, contacts.dim, data.efc_force, model.opt.cone == PYRAMIDAL)
    return by_target(*_by_pair(rows, geoms, forces, contacts.frame, contacts.pos, contacts.dist, is_target, extents))


def by_target(
    starts: NDArray[np.int64],
    targets: NDArray[np.int64],
    others: NDArray[np.int64],
    begins: NDArray[np.int64],
    points: NDArray[np.float64],
    forces: NDArray[np.float64],
    normals: NDArray[np.float64],
) -> dict[int, Contacts]:
    """Contacts of each target, from its first pair in `starts`, [t + 1], and the fields of `Contacts` for all."""
    return {
        target: Contacts(target, others[a:b], begins[a : b + 1], points, forces, normals)
        for target, (a, b) in zip(targets.tolist(), pairwise(starts.tolist()), strict=True)
    }


def smallest_extents(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Smallest half-extent of every geom [m]; planes and height fields have none, and count as endless."""
    endless = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
    return np.where(np.isin(model.geom_type, endless), np.inf, model.geom_aabb[:, 3:].min(axis=1))


@numba.njit(cache=True, nogil=True)
def _on_targets(geoms, address, is_target):
    """Contacts [k] that may bear on a target, of those between geoms [ncon, 2]."""
    rows, count = np.empty(len(geoms), np.int64), 0
    for i in range(len(geoms)):
        first, second = geoms[i, 0], geoms[i, 1]
        # a flex is no geom
        concerned = first >= 0 and second >= 0 and (is_target[first] or is_target[second])
        # without a row in the constraint solver (excluded, or in the margin only) a contact carries no force
        if concerned and address[i] >= 0:
            rows[count] = i
            count += 1
    return rows[:count]


@numba.njit(cache=True, nogil=True)
def _normal_forces(rows, address, dim, efc_force, pyramidal):
    """Normal forces of some contacts [N], [k]."""
    forces = np.empty(len(rows))
    for k in range(len(rows)):
        i = rows[k]
        # the edges of a friction pyramid share the normal force among them
        edges = 2 * (dim[i] - 1) if pyramidal and dim[i] > 1 else 1
        forces[k] = efc_force[address[i] : address[i] + edges].sum()
    return forces


@numba.njit(cache=True, nogil=True)
def _by_pair(rows, geoms, forces, frames, positions, dist, is_target, extents):
    """Targets in ascending order, pair by pair what touches them, and contact by contact how; see `by_target`.

    The forces are those of some rows of the contacts, `geoms` [ncon, 2] the ids of what touches; the first three
    numbers of a frame are the normal that points from the first to the second.
    """
    count = 0
    pair, source = np.empty(2 * len(rows), np.int64), np.empty(2 * len(rows), np.int64)
    for k in range(len(rows)):
        for side in range(2):
            target, other = geoms[rows[k], side], geoms[rows[k], 1 - side]
            if forces[k] > 0 and is_target[target]:
                pair[count], source[count] = target * len(is_target) + other, 2 * k + side
                count += 1
    # a sort that leaves the contacts of a pair in their order
    order = np.argsort(pair[:count], kind="mergesort")
    starts, targets = np.empty(count + 1, np.int64), np.empty(count, np.int64)
    others, begins = np.empty(count, np.int64), np.empty(count + 1, np.int64)
    points, loads, normals = np.empty((count, 3)), np.empty(count), np.empty((count, 3))
    found, pairs, latest = 0, 0, -1
    for j in range(count):
        if pair[order[j]] != latest:
            latest = pair[order[j]]
            target, others[pairs] = divmod(latest, len(is_target))
            begins[pairs] = j
            if found == 0 or target != targets[found - 1]:
                targets[found], starts[found] = target, pairs
                found += 1
            pairs += 1
        k, side = divmod(source[order[j]], 2)
        i = rows[k]
        loads[j] = forces[k]
        # overlaps deeper than a body are none: MuJoCo's speculative contacts say by `dist` how hard to stop what comes
        depth = min(abs(dist[i]), extents[geoms[i, 0]], extents[geoms[i, 1]])
        for axis in range(3):
            # MuJoCo's point lies half-way between the two surfaces, which overlap by -dist: the target's surface is
            # dist/2 away. Somewhat outside of it the nearest surface point is on this side, even of a thin part.
            normals[j, axis] = -frames[i, axis] if side else frames[i, axis]
            points[j, axis] = positions[i, axis] + 1.5 * depth * normals[j, axis]
    starts[found], begins[pairs] = pairs, count
    return starts[: found + 1], targets[:found], others[:pairs], begins[: pairs + 1], points, loads, normals
