"""The footprint cache: footprints under the geoms on a target, reused while their points stay.

Contact forces on the texels of a target, and the shares of the texels in them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints, kernel
from ripple_sim.solver.texels.texel_mesh import TexelGrid
from ripple_sim.solver.waves.footprint import weigh

from .patches import LoadPoints, Patches, squared_distance

# A footprint is reused while its point moves by less than this share of a texel.
_SAME_PLACE = 0.3


class FootprintCache(NamedTuple):
    """Footprints, packed; those of a geom stand together.

    Attributes
    ----------
    geoms : int64 [s]
        Geom ids.
    points : float64 [s, 3]
        Where the load points were when the footprints were made [m].
    radii : float64 [s]
        As they were asked for [m].
    tolerances : float64 [s]
        How far point and radius may move before a footprint is made anew [m].
    begins : int64 [s + 1]
        The texels of footprint i are those from begins[i] to begins[i + 1].
    texels : int64 [t]
        Flat texel indices.
    shares : float64 [t]
        Of a unit force. They add up to 1 within a footprint, or to less where the surface is not movable.
    """

    geoms: Ints
    points: Floats
    radii: Floats
    tolerances: Floats
    begins: Ints
    texels: Ints
    shares: Floats


EMPTY_CACHE = FootprintCache(
    np.zeros(0, np.int64),
    np.zeros((0, 3)),
    np.zeros(0),
    np.zeros(0),
    np.zeros(1, np.int64),
    np.zeros(0, np.int64),
    np.zeros(0),
)


@kernel
def reusable(cache: FootprintCache, points: LoadPoints, states: np.ndarray) -> tuple[Ints, Ints]:
    """Rows of the footprints that serve again.

    Parameters
    ----------
    cache : FootprintCache
    points : LoadPoints
        Where geoms touch now.
    states : CONTACT_STATE [ngeom]

    Returns
    -------
    rows : int64 [n + kept]
        One for each load point, -1 where none serves, and then those of geoms that have lost touch but are still
        active.
    lost : int64 [l]
        Load points that no footprint serves, and whose places on the surface are not known either.
    """
    n, first, count, losses = len(points.geoms), 0, len(points.geoms), 0
    rows, lost, touching = np.empty(n + len(cache.geoms), np.int64), np.empty(n, np.int64), np.zeros(len(states))
    for i in range(n):
        geom, rows[i] = points.geoms[i], -1
        if touching[geom] == 0:
            touching[geom], first = 1, _first_row(cache, geom)
        row = first
        while rows[i] < 0 and row < len(cache.geoms) and cache.geoms[row] == geom:
            moved = np.sqrt(squared_distance(cache.points, row, points.points, i))
            if max(moved, abs(cache.radii[row] - points.radii[i])) <= cache.tolerances[row]:
                rows[i] = row
            row += 1
        if rows[i] < 0 and points.texels[i] < 0:
            lost[losses] = i
            losses += 1
    for row in range(len(cache.geoms)):
        if states[cache.geoms[row]].active and touching[cache.geoms[row]] == 0:
            rows[count] = row
            count += 1
    return rows[:count], lost[:losses]


@kernel
def rebuild(
    cache: FootprintCache, points: LoadPoints, rows: Ints, grid: TexelGrid, movable_area: Floats, scratch: Floats
) -> FootprintCache:
    """Footprints by the rows from `reusable`, made at the places of the load points where none serves.

    Parameters
    ----------
    cache : FootprintCache
    points : LoadPoints
    rows : int64 [s]
    grid : TexelGrid
        Of the target's atlas.
    movable_area : float64 [C n n]
        Area of each texel that loads move [m^2], 0 where nothing moves.
    scratch : float64 [C n n]
        See `distance_scratch`.
    """
    count, room = len(rows), 2 * len(cache.texels) + 1024
    geoms, places = np.empty(count, np.int64), np.empty((count, 3))
    radii, tolerances = np.empty(count), np.empty(count)
    begins, texels, shares = np.zeros(count + 1, np.int64), np.empty(room, np.int64), np.empty(room)
    for i in range(count):
        j, at = rows[i], begins[i]
        if j >= 0:
            geoms[i], radii[i], tolerances[i] = cache.geoms[j], cache.radii[j], cache.tolerances[j]
            first, last, under, weights = cache.begins[j], cache.begins[j + 1], cache.texels, cache.shares
        else:
            geoms[i], radii[i] = points.geoms[i], points.radii[i]
            tolerances[i] = _SAME_PLACE * np.sqrt(grid.areas[points.texels[i]])
            under, weights, _ = weigh(grid, points.texels[i], points.places[i], radii[i], scratch)
            first, last = 0, len(under)
        begins[i + 1] = at + last - first
        while begins[i + 1] > len(texels):
            texels, shares = _doubled(texels, shares)
        for k in range(3):
            places[i, k] = cache.points[j, k] if j >= 0 else points.points[i, k]
        for k in range(first, last):
            texels[at + k - first] = under[k]
            shares[at + k - first] = weights[k] if j >= 0 else weights[k] * movable_area[under[k]]
    end = begins[count]
    return FootprintCache(geoms, places, radii, tolerances, begins, texels[:end], shares[:end])


@kernel
def _first_row(cache: FootprintCache, geom: int) -> int:
    """First footprint of a geom in the cache, or the number of all."""
    row = 0
    while row < len(cache.geoms) and cache.geoms[row] != geom:
        row += 1
    return row


@kernel
def _doubled(texels: Ints, shares: Floats) -> tuple[Ints, Floats]:
    """Both with room for twice as many entries."""
    more_texels, more_shares = np.empty(2 * len(texels), np.int64), np.empty(2 * len(shares))
    for i in range(len(texels)):
        more_texels[i], more_shares[i] = texels[i], shares[i]
    return more_texels, more_shares


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
