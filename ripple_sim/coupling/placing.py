"""Places on a target's surface for the contacts of its collision geoms, which lie off it.

Contacts of collision geoms, handed to the targets in whose place they collide.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Floats, Ints, kernel

from .contacts import TargetContacts
from .model import CoupledModel

# Cosine between the normals of a contact and of the surface, above which the surface faces the contact.
_FACING = 0.25


def places(atlas: Atlas, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Surface points [m], [k, 3], nearest to contact points among those that face the contacts.

    The other side of a thin part may be nearer. Where no part of the surface faces a contact, it is the nearest point.

    Parameters
    ----------
    atlas : Atlas
    points : float64 [k, 3]
        In the frame of the target [m].
    normals : float64 [k, 3]
        From the target to the other geom, unit vectors.
    """
    found, texels = atlas.nearest(points)
    outward = atlas.normals.reshape(-1, 3)
    away = np.flatnonzero(np.einsum("ij,ij->i", outward[texels], normals) <= _FACING)
    if len(away):
        positions = atlas.positions.reshape(-1, 3)
        facing = _nearest_facing(positions, outward, points[away], normals[away])
        found[away[facing >= 0]] = positions[facing[facing >= 0]]
    return found


@kernel
def _nearest_facing(positions: Floats, outward: Floats, points: Floats, normals: Floats) -> Ints:
    """Nearest texel to each point, [k], whose normal agrees with the point's; -1 where none does."""
    found = np.full(len(points), -1)
    for i in range(len(points)):
        least = np.inf
        for texel in range(len(positions)):
            distance2, along = 0.0, 0.0
            for k in range(3):
                distance2 += (positions[texel, k] - points[i, k]) ** 2
                along += outward[texel, k] * normals[i, k]
            if distance2 < least and along > _FACING:
                least, found[i] = distance2, texel
    return found


class _Loose(NamedTuple):
    """Contacts on a target, in any order: others int64 [k]; more as in `TargetContacts`."""

    others: NDArray[np.int64]
    points: NDArray[np.float64]
    forces: NDArray[np.float64]
    normals: NDArray[np.float64]


class CollisionContacts:
    """Hands every contact of a collision geom to one target: where several share the geom, to the nearest.

    Parameters
    ----------
    coupled : CoupledModel
    atlases : mapping
        Geom id of every target to its atlas.

    Attributes
    ----------
    geoms : list of int
        Ids of the geoms that collide for others, or through their convex parts, ascending.
    """

    def __init__(self, coupled: CoupledModel, atlases: Mapping[int, Atlas]) -> None:
        self._atlases = atlases
        self._targets_of: dict[int, list[int]] = {}
        for target in atlases:
            for geom in coupled.collision_geoms(target):
                if geom != target or geom in coupled.convex_colliders:
                    self._targets_of.setdefault(geom, []).append(target)
        self.geoms = sorted(self._targets_of)

    def hand_over(self, data: mujoco.MjData, contacts: dict[int, TargetContacts]) -> dict[int, TargetContacts]:
        """Contacts by target, from those by geom; their points then lie on the targets' surfaces."""
        theirs = [geom for geom in self.geoms if geom in contacts]
        if not theirs:
            return contacts
        handed: dict[int, list[_Loose]] = {}
        for geom in theirs:
            for target, part in self._split(data, self._targets_of[geom], _loose(contacts.pop(geom))):
                handed.setdefault(target, []).append(part)
        for target, parts in handed.items():
            own = [_loose(contacts[target])] if target in contacts else []
            contacts[target] = _by_other(target, [*own, *parts])
        return contacts

    def _split(self, data: mujoco.MjData, targets: Sequence[int], contacts: _Loose) -> list[tuple[int, _Loose]]:
        """The contacts of each target that gets any, at places on its surface."""
        placed = np.array([self._places(data, target, contacts) for target in targets])
        nearest = np.linalg.norm(placed - contacts.points, axis=2).argmin(axis=0)
        parts = []
        for i, target in enumerate(targets):
            mine = nearest == i
            if mine.any():
                parts.append((target, _Loose(*(each[mine] for each in contacts._replace(points=placed[i])))))
        return parts

    def _places(self, data: mujoco.MjData, target: int, contacts: _Loose) -> NDArray[np.float64]:
        """Places of contacts on a target in the world [m], [k, 3]."""
        position, rotation = data.geom_xpos[target], data.geom_xmat[target].reshape(3, 3)
        points, normals = (contacts.points - position) @ rotation, contacts.normals @ rotation
        return position + places(self._atlases[target], points, normals) @ rotation.T


def _loose(contacts: TargetContacts) -> _Loose:
    rows = slice(*contacts.begins[[0, -1]].tolist())
    others = np.repeat(contacts.others, np.diff(contacts.begins))
    return _Loose(others, contacts.points[rows], contacts.forces[rows], contacts.normals[rows])


def _by_other(target: int, parts: Sequence[_Loose]) -> TargetContacts:
    """Contacts of several geoms as those of one target."""
    others, points, forces, normals = (np.concatenate(each) for each in zip(*parts, strict=True))
    order = np.argsort(others, kind="stable")
    ids, first = np.unique(others[order], return_index=True)
    return TargetContacts(target, ids, np.append(first, len(others)), points[order], forces[order], normals[order])
