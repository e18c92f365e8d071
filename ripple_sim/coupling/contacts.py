"""MuJoCo's contacts, one pair of geoms at a time: normal forces and where they act."""

from __future__ import annotations

import dataclasses

import mujoco
import numba
import numpy as np
from numpy.typing import NDArray


@dataclasses.dataclass(frozen=True, eq=False)
class ContactPair:
    """All contacts between a target and another geom in one step.

    Attributes
    ----------
    target, other : int
        Geom ids.
    points : float64 [k, 3]
        Contact points in the world [m], just outside the target's surface.
    forces : float64 [k]
        Normal forces [N], all positive.
    normals : float64 [k, 3]
        Unit normals in the world, from the target to the other geom.
    """

    target: int
    other: int
    points: NDArray[np.float64]
    forces: NDArray[np.float64]
    normals: NDArray[np.float64]


def contact_pairs(
    model: mujoco.MjModel, data: mujoco.MjData, is_target: NDArray[np.bool_], extents: NDArray[np.float64]
) -> dict[tuple[int, int], ContactPair]:
    """Collect the pressing contacts of some geoms, by (target, other) in ascending order.

    Where two targets touch, the pair is reported for each of them.

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
    targets, others, points, forces, normals = _pressing(
        contacts.geom,
        contacts.efc_address,
        contacts.dim,
        contacts.dist,
        contacts.pos,
        contacts.frame,
        data.efc_force,
        model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL,
        is_target,
        extents,
    )
    pairs = list(zip(targets.tolist(), others.tolist(), strict=True))
    found, begin = {}, 0
    for end in range(1, len(pairs) + 1):
        if end == len(pairs) or pairs[end] != pairs[begin]:
            rows = slice(begin, end)
            found[pairs[begin]] = ContactPair(*pairs[begin], points[rows], forces[rows], normals[rows])
            begin = end
    return found


def smallest_extents(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Smallest half-extent of every geom [m]; planes and height fields have none, and count as endless."""
    endless = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
    return np.where(np.isin(model.geom_type, endless), np.inf, model.geom_aabb[:, 3:].min(axis=1))


@numba.njit(cache=True)
def _pressing(geoms, address, dim, dist, pos, frame, efc_force, pyramidal, is_target, extents):
    """Target, other, point, normal force and normal of all contacts that press on a target, pair by pair."""
    most = 2 * len(geoms)
    targets, others, forces = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most)
    points, normals = np.empty((most, 3)), np.empty((most, 3))
    count = 0
    for i in range(len(geoms)):
        first, second = geoms[i, 0], geoms[i, 1]
        # without a row in the constraint solver (excluded, or in the margin only) a contact carries no force; a
        # flex is no geom
        if address[i] < 0 or first < 0 or second < 0 or not (is_target[first] or is_target[second]):
            continue
        # the edges of a friction pyramid share the normal force among them
        rows = 2 * (dim[i] - 1) if pyramidal and dim[i] > 1 else 1
        force = efc_force[address[i] : address[i] + rows].sum()
        if force <= 0:
            continue
        # overlaps deeper than a body are none: MuJoCo's speculative contacts say by `dist` how hard to stop what comes
        depth = min(abs(dist[i]), extents[first], extents[second])
        for target, other, side in ((first, second, 1.0), (second, first, -1.0)):
            if is_target[target]:
                targets[count], others[count], forces[count] = target, other, force
                for k in range(3):
                    # MuJoCo's point lies half-way between the two surfaces, which overlap by -dist: the target's
                    # surface is dist/2 away. Somewhat outside of it the nearest surface point is on this side, even of
                    # a thin part.
                    normals[count, k] = side * frame[i, k]
                    points[count, k] = pos[i, k] + 1.5 * depth * normals[count, k]
                count += 1
    # a sort that leaves the contacts of a pair in their order
    order = np.argsort(targets[:count] * len(is_target) + others[:count], kind="mergesort")
    return targets[order], others[order], points[order], forces[order], normals[order]
