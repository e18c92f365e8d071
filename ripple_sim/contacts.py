"""MuJoCo's contacts, one pair of geoms at a time: normal forces and where they act."""

from __future__ import annotations

import dataclasses

import mujoco
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
        Contact points in the world [m], half-way between the two surfaces.
    forces : float64 [k]
        Normal forces [N], all positive.
    """

    target: int
    other: int
    points: NDArray[np.float64]
    forces: NDArray[np.float64]


def contact_pairs(model: mujoco.MjModel, data: mujoco.MjData, targets: set[int]) -> list[ContactPair]:
    """Collect the pressing contacts of the given geoms, in ascending order of (target, other).

    Where two targets touch, the pair is reported for each of them.
    """
    found: dict[tuple[int, int], list[tuple[NDArray, float]]] = {}
    wrench = np.zeros(6)
    for i in range(data.ncon):
        contact = data.contact[i]
        first, second = int(contact.geom[0]), int(contact.geom[1])
        # without a row in the constraint solver (excluded, or in the margin only) a contact carries no force
        if contact.efc_address < 0 or not (first in targets or second in targets):
            continue
        mujoco.mj_contactForce(model, data, i, wrench)
        if wrench[0] <= 0:
            continue
        entry = (contact.pos.copy(), float(wrench[0]))
        if first in targets:
            found.setdefault((first, second), []).append(entry)
        if second in targets:
            found.setdefault((second, first), []).append(entry)
    return [
        ContactPair(target, other, np.array([p for p, _ in entries]), np.array([f for _, f in entries]))
        for (target, other), entries in sorted(found.items())
    ]


def cluster(points: NDArray[np.float64], forces: NDArray[np.float64], radius: float) -> list[tuple[NDArray, float]]:
    """Join contacts that lie within a radius [m] of the strongest one: force-weighted points and summed forces.

    What lies farther apart (the two ends of a capsule) stays apart. The forces of the clusters add up to the total.
    """
    clusters = []
    left = np.ones(len(forces), dtype=bool)
    while left.any():
        strongest = np.flatnonzero(left)[np.argmax(forces[left])]
        near = left & (np.linalg.norm(points - points[strongest], axis=1) <= radius)
        force = float(forces[near].sum())
        clusters.append((forces[near] @ points[near] / force, force))
        left &= ~near
    return clusters
