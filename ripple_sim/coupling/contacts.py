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


def contact_pairs(model: mujoco.MjModel, data: mujoco.MjData, targets: set[int]) -> list[ContactPair]:
    """Collect the pressing contacts of the given geoms, in ascending order of (target, other).

    Where two targets touch, the pair is reported for each of them.
    """
    found: dict[tuple[int, int], list[tuple[NDArray, float, NDArray]]] = {}
    wrench = np.zeros(6)
    contacts = data.contact
    geoms, address = contacts.geom.tolist(), contacts.efc_address.tolist()
    for i, (first, second) in enumerate(geoms):
        # without a row in the constraint solver (excluded, or in the margin only) a contact carries no force
        if address[i] < 0 or not (first in targets or second in targets):
            continue
        mujoco.mj_contactForce(model, data, i, wrench)
        if wrench[0] <= 0:
            continue
        contact = contacts[i]
        # MuJoCo's point lies half-way between the two surfaces, which overlap by -dist: the target's surface is dist/2
        # away. Somewhat outside of it the nearest surface point is on this side, even of a thin part.
        middle, normal, away = contact.pos, contact.frame[:3], 1.5 * abs(contact.dist)
        for target, other, outward in ((first, second, normal), (second, first, -normal)):
            if target in targets:
                entry = (middle + away * outward, float(wrench[0]), outward.copy())
                found.setdefault((target, other), []).append(entry)
    return [
        ContactPair(target, other, *(np.array(column) for column in zip(*entries, strict=True)))
        for (target, other), entries in sorted(found.items())
    ]
