"""The contact patches of all geoms on one target, packed: compiled code goes through them in one call.

Contacts joined where they are near each other: the corners of a contact patch.

The points over which the force of one contact patch is spread.

Contacts mark the corners of the patch. Between two of them a convex geom touches as well, provided that the target's
surface is there. The force is spread as the midpoint of two contacts drawn at random, each with a probability in
proportion to its force: force and torque stay the same, and four equal corners of a square, or two ends of a line,
spread it evenly.

Poses of geoms, and points taken into their frames and back into the world.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel

from .contacts import TargetContacts

MAX_CLUSTERS = 8


@kernel
def cluster(points: Floats, forces: Floats, radius: float) -> tuple[Floats, Floats]:
    """Join contacts within a radius [m] of the strongest: force-weighted points [c, 3] and summed forces [c].

    Contacts farther apart (the two ends of a capsule) stay apart, up to eight clusters; then the rest joins the
    nearest. The forces of the clusters add up to the total.

    Parameters
    ----------
    points : float64 [k, 3]
        [m].
    forces : float64 [k]
        All of one sign [N].
    radius : float
    """
    owner, seeds, count = np.empty(len(forces), np.int64), np.empty(MAX_CLUSTERS, np.int64), 0
    for i in range(len(forces)):
        owner[i] = -1
    while count < MAX_CLUSTERS:
        seed = -1
        for i in range(len(forces)):
            if owner[i] < 0 and (seed < 0 or abs(forces[i]) > abs(forces[seed])):
                seed = i
        if seed < 0:
            break
        for i in range(len(forces)):
            if owner[i] < 0 and squared_distance(points, i, points, seed) <= radius**2:
                owner[i] = count
        seeds[count] = seed
        count += 1
    means, totals = np.zeros((count, 3)), np.zeros(count)
    for i in range(len(forces)):
        if owner[i] < 0:
            owner[i] = 0
            for j in range(1, count):
                if squared_distance(points, i, points, seeds[j]) < squared_distance(points, i, points, seeds[owner[i]]):
                    owner[i] = j
        _add(means, totals, owner[i], points, forces, i)
    _divide(means, totals, count)
    return means, totals


@kernel
def merge_near(points: Floats, forces: Floats, near: float) -> tuple[Floats, Floats]:
    """Force-weighted means and sums of the points, each merged with the first one within `near` [m]."""
    means, totals, count = np.zeros((len(forces), 3)), np.zeros(len(forces)), 0
    first = np.empty(len(forces), np.int64)
    for i in range(len(forces)):
        owner = 0
        while owner < count and squared_distance(points, i, points, first[owner]) > near**2:
            owner += 1
        if owner == count:
            first[count] = i
            count += 1
        _add(means, totals, owner, points, forces, i)
    _divide(means, totals, count)
    return means[:count], totals[:count]


# Number by number: expressions of arrays and assignments to slices take many times longer to compile.
@kernel
def _add(means: Floats, totals: Floats, owner: int, points: Floats, forces: Floats, i: int) -> None:
    """Add point and force i to the sums of its owner."""
    totals[owner] += forces[i]
    for k in range(3):
        means[owner, k] += forces[i] * points[i, k]


@kernel
def _divide(means: Floats, totals: Floats, count: int) -> None:
    """Divide the first sums of points by those of forces."""
    for j in range(count):
        for k in range(3):
            means[j, k] /= totals[j]


@kernel
def squared_distance(points: Floats, i: int, others: Floats, j: int) -> float:
    """Of row i of some points from row j of others, [m^2]."""
    total = 0.0
    for k in range(3):
        total += (points[i, k] - others[j, k]) ** 2
    return total


# Points on the rim of a patch stand for half a cell, those at its corners for a quarter: their centres lie farther in.
_INSET = 0.75
# Footprint radius over the patch's size at which the footprints of the points of a square or a line just overlap.
_OVERLAP = 0.3


@kernel
def find_probes(points: Floats, forces: Floats, radius: float, convex: bool) -> tuple[Floats, Floats]:
    """Forces at the corners of a patch [N], [c], and its probes [m], [q, 3].

    Probes are the points whose distances from the surface decide over the patch: the corners first, then, where the
    geom is convex, the midpoints of all pairs of corners.

    Parameters
    ----------
    points : float64 [k, 3]
        Contact points near the surface, in the target's frame [m].
    forces : float64 [k]
        [N].
    radius : float
        Footprint radius of a single contact [m].
    convex : bool
        Whether the geom that touches is.
    """
    corners, corner_forces = cluster(points, forces, radius)
    count = len(corner_forces)
    if count == 1 or not convex:
        return corner_forces, corners
    probes = np.empty((count * (count + 1) // 2, 3))
    for i in range(count):
        for k in range(3):
            probes[i, k] = corners[i, k]
    row = count
    for i in range(count):
        for j in range(i + 1, count):
            for k in range(3):
                probes[row, k] = (corners[i, k] + corners[j, k]) / 2
            row += 1
    return corner_forces, probes


@kernel
def spread(corner_forces: Floats, probes: Floats, surface: Floats, radius: float) -> tuple[Floats, Floats, float, Ints]:
    """Spread the force of a patch over its probes.

    Parameters
    ----------
    corner_forces, probes
        From `find_probes`.
    surface : float64 [q, 3]
        The surface points nearest to the probes [m].
    radius : float
        Footprint radius of a single contact [m].

    Returns
    -------
    points : float64 [n, 3]
        [m].
    forces : float64 [n]
        [N].
    radius : float
        Footprint radius [m]: it grows with the patch.
    rows : int64 [n]
        Which of the probes the points are, -1 for those that are none.
    """
    if len(probes) == len(corner_forces):
        rows = np.empty(len(probes), np.int64)
        for i in range(len(rows)):
            rows[i] = i
        return probes, corner_forces, radius, rows
    forces, size = _probe_forces(corner_forces, probes, surface, radius)
    touching = _touching(forces)
    if len(touching) < len(probes):
        points, pushing = np.empty((len(touching), 3)), np.empty(len(touching))
        for i in range(len(touching)):
            pushing[i] = forces[touching[i]]
            for k in range(3):
                points[i, k] = probes[touching[i], k]
        return points, pushing, radius, touching
    total, inset = 0.0, np.empty((len(probes), 3))
    for i in range(len(corner_forces)):
        total += corner_forces[i]
    for k in range(3):
        middle = 0.0
        for i in range(len(corner_forces)):
            middle += corner_forces[i] / total * probes[i, k]
        for i in range(len(probes)):
            inset[i, k] = middle + _INSET * (probes[i, k] - middle)
    points, pushing = merge_near(inset, forces, size / 8)
    for i in range(len(pushing)):
        touching[i] = -1
    return points, pushing, max(radius, _OVERLAP * size), touching[: len(pushing)]


@kernel
def _touching(forces: Floats) -> Ints:
    """Where there is a force."""
    count, found = 0, np.empty(len(forces), np.int64)
    for i in range(len(forces)):
        if forces[i] != 0:
            found[count] = i
            count += 1
    return found[:count]


@kernel
def _probe_forces(corner_forces: Floats, probes: Floats, surface: Floats, radius: float) -> tuple[Floats, float]:
    """Forces at the probes [N], [q], 0 for midpoints off the surface, and the size of the patch [m]."""
    count, total, forces = len(corner_forces), 0.0, np.zeros(len(probes))
    # contact points lie a little outside the surface, by up to their depth: so may the midpoints
    limit = 0.0
    for i in range(count):
        total += corner_forces[i]
        limit = max(limit, np.sqrt(squared_distance(surface, i, probes, i)))
    limit += radius / 10
    for i in range(count):
        forces[i] = corner_forces[i] ** 2 / total
    size, row = 0.0, count
    for i in range(count):
        for j in range(i + 1, count):
            share = corner_forces[i] * corner_forces[j] / total
            if np.sqrt(squared_distance(surface, row, probes, row)) <= limit:
                forces[row] = 2 * share
            else:
                # where there is no touch between two corners, they keep their shares
                forces[i] += share
                forces[j] += share
            size = max(size, np.sqrt(squared_distance(probes, i, probes, j)))
            row += 1
    return forces, size


class Pose(NamedTuple):
    """Of a geom in the world: position float64 [3] [m], and rotation float64 [3, 3] from its frame to the world."""

    position: Floats
    rotation: Floats


@kernel
def in_frame(points: Floats, pose: Pose) -> Floats:
    """Points in the world [m], [k, 3], taken into the frame of a geom."""
    local = np.zeros((len(points), 3))
    for i in range(len(points)):
        for k in range(3):
            for j in range(3):
                local[i, k] += (points[i, j] - pose.position[j]) * pose.rotation[j, k]
    return local


@kernel
def in_world(points: Floats, pose: Pose) -> Floats:
    """Points in the frame of a geom [m], [k, 3], taken into the world."""
    world = np.empty((len(points), 3))
    for i in range(len(points)):
        for k in range(3):
            across = 0.0
            for j in range(3):
                across += pose.rotation[k, j] * points[i, j]
            world[i, k] = pose.position[k] + across
    return world


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
