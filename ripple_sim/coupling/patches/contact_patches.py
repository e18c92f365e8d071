"""The patches of all bodies that press on one target, packed: compiled code goes through them in one call."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from .clusters import MAX_CONTACTS, probe, spread


class Patches(NamedTuple):
    """Where bodies may press on a target, before its surface is asked.

    Attributes
    ----------
    forces : float64 [p]
        Normal force of each body [N].
    radii : float64 [p]
        Footprint radius of a single contact with it [m].
    begins : int64 [p + 1]
        The points of body i are those from begins[i] to begins[i + 1].
    probes : int64 [p]
        Where the probes of body i begin among them: what is before is the force-weighted middle of its contacts. Where
        there is but one corner, that is the middle.
    corners : int64 [p]
        How many of the probes are corners.
    points : float64 [m, 3]
        In the target's frame [m].
    loads : float64 [m]
        Forces at the corners [N], 0 at all other points.
    """

    forces: NDArray[np.float64]
    radii: NDArray[np.float64]
    begins: NDArray[np.int64]
    probes: NDArray[np.int64]
    corners: NDArray[np.int64]
    points: NDArray[np.float64]
    loads: NDArray[np.float64]


class Spots(NamedTuple):
    """Points at which bodies press on a target, 36 of each body at most.

    Attributes
    ----------
    begins : int64 [p + 1]
        The spots of body i are those from begins[i] to begins[i + 1].
    bodies : int64 [n]
        The geom id of each.
    points : float64 [n, 3]
        Near the surface, in the target's frame [m].
    forces : float64 [n]
        [N].
    radii : float64 [n]
        Footprint radii [m].
    places : float64 [n, 3]
        Nearest points of the surface [m], where `texels` is not negative.
    texels : int64 [n]
        Flat indices of the texels nearest to them, -1 where they are not known yet.
    """

    begins: NDArray[np.int64]
    bodies: NDArray[np.int64]
    points: NDArray[np.float64]
    forces: NDArray[np.float64]
    radii: NDArray[np.float64]
    places: NDArray[np.float64]
    texels: NDArray[np.int64]


@numba.njit(cache=True, nogil=True)
def find_patches(contacts, position, rotation, radii, convex):
    """Patches of a target's `Contacts`.

    Parameters
    ----------
    contacts : Contacts
    position : float64 [3]
        Of the target in the world [m].
    rotation : float64 [3, 3]
        From the target's frame to the world.
    radii : float64 [ngeom]
        Footprint radius of each geom [m]: the smaller one of a pair counts.
    convex : bool [ngeom]
    """
    bodies = len(contacts.others)
    most = bodies * (1 + MAX_CONTACTS * (MAX_CONTACTS + 1) // 2)
    forces, used, points, loads = np.zeros(bodies), np.empty(bodies), np.empty((most, 3)), np.zeros(most)
    begins, probes, corners = np.zeros(bodies + 1, np.int64), np.empty(bodies, np.int64), np.empty(bodies, np.int64)
    for i in range(bodies):
        first, last = contacts.begins[i], contacts.begins[i + 1]
        local, pressing = _carried(contacts.points[first:last], position, rotation), contacts.forces[first:last]
        middle = np.zeros(3)
        for j in range(len(local)):
            forces[i] += pressing[j]
            middle += pressing[j] * local[j]
        used[i] = min(radii[contacts.target], radii[contacts.others[i]])
        at_corners, found = probe(local, pressing, used[i], convex[contacts.others[i]])
        corners[i] = len(at_corners)
        points[begins[i]] = middle / forces[i]
        probes[i] = row = begins[i] + 1 if corners[i] > 1 else begins[i]
        begins[i + 1] = row + len(found)
        points[row : begins[i + 1]] = found
        loads[row : row + corners[i]] = at_corners
    return Patches(forces, used, begins, probes, corners, points[: begins[bodies]], loads[: begins[bodies]])


@numba.njit(cache=True, nogil=True)
def find_spots(others, patches, surface, texels, share):
    """Where bodies press, told from the surface points [m, 3] and texels [m] nearest to the points of their patches.

    `others` [p] are the geom ids of the bodies; the forces are multiplied by a share.
    """
    most, begins = len(patches.points), np.zeros(len(others) + 1, np.int64)
    bodies, points, forces, radii = np.empty(most, np.int64), np.empty((most, 3)), np.empty(most), np.empty(most)
    places, nearest = np.empty((most, 3)), np.full(most, -1)
    for i in range(len(others)):
        first, last = patches.probes[i], patches.begins[i + 1]
        loads = share * patches.loads[first : first + patches.corners[i]]
        at, pressing, radius, rows = spread(loads, patches.points[first:last], surface[first:last], patches.radii[i])
        row = begins[i]
        begins[i + 1] = row + len(pressing)
        for j in range(len(pressing)):
            bodies[row + j], points[row + j] = others[i], at[j]
            forces[row + j], radii[row + j] = pressing[j], radius
            if rows[j] >= 0:
                places[row + j], nearest[row + j] = surface[first + rows[j]], texels[first + rows[j]]
    n = begins[-1]
    return Spots(begins, bodies[:n], points[:n], forces[:n], radii[:n], places[:n], nearest[:n])


@numba.njit(cache=True, nogil=True)
def _carried(points, position, rotation):
    """Points in the world [k, 3], carried into a frame."""
    local = np.empty_like(points)
    for i in range(len(points)):
        for k in range(3):
            local[i, k] = 0.0
            for j in range(3):
                local[i, k] += (points[i, j] - position[j]) * rotation[j, k]
    return local
