"""Places on a target's surface for the contacts of its collision geoms, which lie off it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Floats, Ints, kernel

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
