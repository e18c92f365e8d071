"""Contact forces on the texels of a target, and the shares of the texels in them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints, kernel

from .footprints import FootprintCache
from .patches import LoadPoints, Patches


class TexelForces(NamedTuple):
    """Contact forces on the texels of a target in one step, geom by geom.

    Attributes
    ----------
    geoms : int64 [p]
        Geom ids, ascending.
    middles : float64 [p, 3]
        Force-weighted contact points [m].
    place_radii : float64 [p]
        A geom has left its place where its contact point has moved by more than this [m].
    begins : int64 [p + 1]
        The texels of geom i are those from begins[i] to begins[i + 1].
    texels : int64 [k]
        Flat texel indices.
    forces : float64 [k]
        [N].
    """

    geoms: Ints
    middles: Floats
    place_radii: Floats
    begins: Ints
    texels: Ints
    forces: Floats


NO_FORCES = TexelForces(
    np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0), np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0)
)


class MeanShares(NamedTuple):
    """Texels under the geoms, [k], and the mean share of each in the force of its geom; those of a geom add up to 1."""

    texels: Ints
    shares: Floats


NO_SHARES = MeanShares(np.zeros(0, np.int64), np.zeros(0))


@kernel
def texel_forces(patches: Patches, points: LoadPoints, cache: FootprintCache) -> TexelForces:
    """Forces on texels; the first footprints of the cache are those of the load points."""
    geoms, count = len(patches.geoms), cache.begins[len(points.forces)]
    middles, place_radii, begins = np.empty((geoms, 3)), np.empty(geoms), np.zeros(geoms + 1, np.int64)
    forces = np.empty(count)
    for i in range(geoms):
        for k in range(3):
            middles[i, k] = patches.points[patches.begins[i], k]
        place_radii[i] = points.radii[points.begins[i]] / 2
        begins[i + 1] = cache.begins[points.begins[i + 1]]
        for j in range(points.begins[i], points.begins[i + 1]):
            for k in range(cache.begins[j], cache.begins[j + 1]):
                forces[k] = points.forces[j] * cache.shares[k]
    return TexelForces(patches.geoms, middles, place_radii, begins, cache.texels[:count], forces)
