"""The footprints under the bodies that press on a target, used again while their points stay."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from ripple_sim.coupling.patches.clusters import squared_distance
from ripple_sim.solver.waves.footprint import weigh

# A footprint is used again while its point moves by less than this share of a texel.
_SAME_PLACE = 0.3


class Footprints(NamedTuple):
    """Footprints, packed; those of a body stand together.

    Attributes
    ----------
    bodies : int64 [s]
        Geom ids of the bodies.
    points : float64 [s, 3]
        Where the spots were when the footprints were made [m].
    radii : float64 [s]
        As they were asked for [m].
    tolerances : float64 [s]
        How far point and radius may move before a footprint is made anew [m].
    begins : int64 [s + 1]
        The texels of footprint i are those from begins[i] to begins[i + 1].
    texels : int64 [t]
        Flat texel indices.
    shares : float64 [t]
        Of a unit source. They add up to 1 within a footprint, or less where the surface does not move.
    """

    bodies: NDArray[np.int64]
    points: NDArray[np.float64]
    radii: NDArray[np.float64]
    tolerances: NDArray[np.float64]
    begins: NDArray[np.int64]
    texels: NDArray[np.int64]
    shares: NDArray[np.float64]


NO_FOOTPRINTS = Footprints(
    np.zeros(0, np.int64),
    np.zeros((0, 3)),
    np.zeros(0),
    np.zeros(0),
    np.zeros(1, np.int64),
    np.zeros(0, np.int64),
    np.zeros(0),
)


@numba.njit(cache=True, nogil=True)
def used_before(known, spots, states):
    """Rows of the known footprints that serve again.

    Parameters
    ----------
    known : Footprints
    spots : Spots
        Where bodies touch now.
    states : BODY [ngeom]

    Returns
    -------
    rows : int64 [n + kept]
        One for each spot, -1 where none serves, and then those of bodies that have lost touch but have not left.
    lost : int64 [l]
        Spots that none serves, and whose places on the surface are not known either.
    """
    n, count = len(spots.bodies), len(spots.bodies)
    rows, touching = np.full(n + len(known.bodies), -1), np.zeros(len(states), np.bool_)
    first = 0
    for spot in range(n):
        body = spots.bodies[spot]
        if not touching[body]:
            touching[body] = True
            first = _first_row(known, body)
        row = first
        while rows[spot] < 0 and row < len(known.bodies) and known.bodies[row] == body:
            moved = np.sqrt(squared_distance(known.points, row, spots.points, spot))
            if max(moved, abs(known.radii[row] - spots.radii[spot])) <= known.tolerances[row]:
                rows[spot] = row
            row += 1
    for row in range(len(known.bodies)):
        if states[known.bodies[row]].here and not touching[known.bodies[row]]:
            rows[count] = row
            count += 1
    return rows[:count], np.flatnonzero((rows[:n] < 0) & (spots.texels < 0))


@numba.njit(cache=True, nogil=True)
def lay(known, spots, rows, grid, carried, scratch):
    """Footprints by the rows that `used_before` gives, made at the spots' places where none serves.

    Parameters
    ----------
    known : Footprints
    spots : Spots
    rows : int64 [s]
    grid : TexelGrid
        Of the target's atlas.
    carried : float64 [6 N N]
        Area of each texel that takes up pressure [m^2], 0 where nothing moves.
    scratch : float64 [6 N N]
        See `distance_scratch`.
    """
    count, room = len(rows), 2 * len(known.texels) + 1024
    bodies, points = np.empty(count, np.int64), np.empty((count, 3))
    radii, tolerances = np.empty(count), np.empty(count)
    begins, all_texels, all_shares = np.zeros(count + 1, np.int64), np.empty(room, np.int64), np.empty(room)
    for i in range(count):
        j = rows[i]
        if j >= 0:
            bodies[i], points[i], radii[i] = known.bodies[j], known.points[j], known.radii[j]
            tolerances[i], old = known.tolerances[j], slice(known.begins[j], known.begins[j + 1])
            texels, shares = known.texels[old], known.shares[old]
        else:
            bodies[i], points[i], radii[i] = spots.bodies[i], spots.points[i], spots.radii[i]
            tolerances[i] = _SAME_PLACE * np.sqrt(grid.areas[spots.texels[i]])
            texels, weights, _ = weigh(grid, spots.texels[i], spots.places[i], radii[i], scratch)
            shares = weights * carried[texels]
        begins[i + 1] = begins[i] + len(texels)
        while begins[i + 1] > len(all_texels):
            all_texels, all_shares = _longer(all_texels), _longer(all_shares)
        new = slice(begins[i], begins[i + 1])
        all_texels[new], all_shares[new] = texels, shares
    end = begins[count]
    return Footprints(bodies, points, radii, tolerances, begins, all_texels[:end], all_shares[:end])


@numba.njit(cache=True, nogil=True)
def _first_row(known, body):
    row = 0
    while row < len(known.bodies) and known.bodies[row] != body:
        row += 1
    return row


@numba.njit(cache=True, nogil=True)
def _longer(array):
    longer = np.empty(2 * len(array), array.dtype)
    longer[: len(array)] = array
    return longer
