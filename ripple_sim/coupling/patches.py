"""The contact patches of all geoms on one target, packed: compiled code goes through them in one call."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel

from .clusters import MAX_CLUSTERS
from .contacts import TargetContacts
from .load_points import find_probes, spread
from .pose import Pose, in_frame


class Patches(NamedTuple):
    """Where geoms may load a target, before its surface is asked.

    Attributes
    ----------
    geoms : int64 [p]
        Geom ids, ascending.
    forces : float64 [p]
        Normal force of each geom [N].
    radii : float64 [p]
        Footprint radius of a single contact with it [m].
    begins : int64 [p + 1]
        The points of geom i are those from begins[i] to begins[i + 1].
    probes : int64 [p]
        Where the probes of geom i begin among them: the point before is the force-weighted middle of its contacts. With
        a single corner, that is the middle.
    corners : int64 [p]
        How many of the probes are corners.
    points : float64 [m, 3]
        In the target's frame [m].
    corner_forces : float64 [m]
        Forces at the corners [N], 0 at all other points.
    """

    geoms: Ints
    forces: Floats
    radii: Floats
    begins: Ints
    probes: Ints
    corners: Ints
    points: Floats
    corner_forces: Floats


class LoadPoints(NamedTuple):
    """Points that carry the forces of the patches, 36 a geom at most.

    Attributes
    ----------
    begins : int64 [p + 1]
        The points of patch i are those from begins[i] to begins[i + 1].
    geoms : int64 [n]
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

    begins: Ints
    geoms: Ints
    points: Floats
    forces: Floats
    radii: Floats
    places: Floats
    texels: Ints


@kernel
def find_patches(contacts: TargetContacts, pose: Pose, radii: Floats, convex: Bools) -> Patches:
    """Patches of a target's contacts.

    Parameters
    ----------
    contacts : TargetContacts
    pose : Pose
        Of the target.
    radii : float64 [ngeom]
        Footprint radius of each geom [m]: of a pair the smaller one counts.
    convex : bool [ngeom]
    """
    count = len(contacts.others)
    most = count * (1 + MAX_CLUSTERS * (MAX_CLUSTERS + 1) // 2)
    forces, used, points, corner_forces = np.zeros(count), np.empty(count), np.empty((most, 3)), np.zeros(most)
    begins, probes, corners = np.zeros(count + 1, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    for i in range(count):
        first, last = contacts.begins[i], contacts.begins[i + 1]
        local, pushing = in_frame(contacts.points[first:last], pose), contacts.forces[first:last]
        used[i] = min(radii[contacts.target], radii[contacts.others[i]])
        at_corners, found = find_probes(local, pushing, used[i], convex[contacts.others[i]])
        corners[i] = len(at_corners)
        forces[i] = _middle(local, pushing, points[begins[i]])
        probes[i] = row = begins[i] + 1 if corners[i] > 1 else begins[i]
        begins[i + 1] = row + len(found)
        for j in range(len(found)):
            for k in range(3):
                points[row + j, k] = found[j, k]
        for j in range(corners[i]):
            corner_forces[row + j] = at_corners[j]
    end = begins[count]
    return Patches(contacts.others, forces, used, begins, probes, corners, points[:end], corner_forces[:end])


@kernel
def _middle(points: Floats, forces: Floats, middle: Floats) -> float:
    """Fill in the force-weighted middle [3] of some points, and return the sum of the forces."""
    total = 0.0
    for i in range(len(forces)):
        total += forces[i]
    for k in range(3):
        middle[k] = 0.0
        for i in range(len(forces)):
            middle[k] += forces[i] * points[i, k]
        middle[k] /= total
    return total


@kernel
def find_load_points(patches: Patches, surface: Floats, texels: Ints, share: float) -> LoadPoints:
    """Points that carry the forces of the patches, multiplied by a share.

    Parameters
    ----------
    patches : Patches
    surface : float64 [m, 3]
        Surface points nearest to those of the patches [m].
    texels : int64 [m]
        Flat indices of the texels nearest to them.
    share : float
    """
    most, begins = len(patches.points), np.zeros(len(patches.geoms) + 1, np.int64)
    geoms, points, forces, radii = np.empty(most, np.int64), np.empty((most, 3)), np.empty(most), np.empty(most)
    places, nearest = np.empty((most, 3)), np.empty(most, np.int64)
    for i in range(len(patches.geoms)):
        first, last = patches.probes[i], patches.begins[i + 1]
        at_corners = np.empty(patches.corners[i])
        for j in range(len(at_corners)):
            at_corners[j] = share * patches.corner_forces[first + j]
        at, pushing, radius, rows = spread(
            at_corners, patches.points[first:last], surface[first:last], patches.radii[i]
        )
        begins[i + 1] = begins[i] + len(pushing)
        for j in range(len(pushing)):
            row, probe = begins[i] + j, first + rows[j]
            geoms[row], forces[row], radii[row], nearest[row] = patches.geoms[i], pushing[j], radius, -1
            for k in range(3):
                points[row, k] = at[j, k]
            if rows[j] >= 0:
                nearest[row] = texels[probe]
                for k in range(3):
                    places[row, k] = surface[probe, k]
    n = begins[len(patches.geoms)]
    return LoadPoints(begins, geoms[:n], points[:n], forces[:n], radii[:n], places[:n], nearest[:n])
