"""Where a body presses on a target: contacts joined where they are near, filled in where they bound a flat patch.

Contacts mark the corners of the patch. Between two of them a convex body touches as well, provided that the target's
surface is there. The force is spread as the middle of two contacts drawn at random, each with a chance in proportion to
its force: force and torque stay what they are, and four equal corners of a square, or two ends of a line, press evenly
over it.
"""

from __future__ import annotations

import numba
import numpy as np

MAX_CONTACTS = 8

# Nodes at the rim of a patch stand for half a cell, those at its corners for a quarter: their middles lie further in.
_INSET = 0.75
# Footprint radius over the patch's size, at which the footprints of the nodes of a square or a line just overlap.
_OVERLAP = 0.3


@numba.njit(cache=True, nogil=True)
def cluster(points, forces, radius):
    """Join contacts that lie within a radius [m] of the strongest one: force-weighted points and summed forces.

    What lies farther apart (the two ends of a capsule) stays apart, up to eight clusters; then the rest goes to the
    nearest. The forces of the clusters add up to the total.

    Parameters
    ----------
    points : float64 [k, 3]
    forces : float64 [k]
        Positive.
    radius : float
    """
    owner = np.full(len(forces), -1)
    seeds = np.empty(MAX_CONTACTS, np.int64)
    count = 0
    while count < MAX_CONTACTS:
        seed = -1
        for i in range(len(forces)):
            if owner[i] < 0 and (seed < 0 or forces[i] > forces[seed]):
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
        totals[owner[i]] += forces[i]
        means[owner[i]] += forces[i] * points[i]
    for j in range(count):
        means[j] /= totals[j]
    return means, totals


@numba.njit(cache=True, nogil=True)
def squared_distance(points, i, others, j):
    """Of row i of some points from row j of others, [m^2]."""
    total = 0.0
    for k in range(3):
        total += (points[i, k] - others[j, k]) ** 2
    return total


@numba.njit(cache=True, nogil=True)
def probe(points, forces, radius, convex):
    """Forces at the corners of a patch [N], and its probes [m].

    Probes are the points whose distances from the surface decide over the patch: the corners and, where the body is
    convex, the middles of all pairs of them.

    Parameters
    ----------
    points : float64 [k, 3]
        Contact points near the surface, in the target's frame [m].
    forces : float64 [k]
        [N].
    radius : float
        Footprint radius of a single contact [m].
    convex : bool
    """
    corners, loads = cluster(points, forces, radius)
    count = len(loads)
    if count == 1 or not convex:
        return loads, corners
    probes = np.empty((count * (count + 1) // 2, 3))
    probes[:count] = corners
    row = count
    for i in range(count):
        for j in range(i + 1, count):
            probes[row] = (corners[i] + corners[j]) / 2
            row += 1
    return loads, probes


@numba.njit(cache=True, nogil=True)
def spread(loads, probes, surface, radius):
    """Points, forces and radius of what presses, told from the surface points nearest to the probes, [m, 3].

    And which of the probes the points are, [n], -1 for those that are none. The radius grows with the patch.
    """
    count, total = len(loads), loads.sum()
    if len(probes) == count:
        return probes, loads, radius, np.arange(count)
    away = np.array([np.sqrt(squared_distance(surface, i, probes, i)) for i in range(len(probes))])
    # contact points lie a little outside of the surface, by up to their depth: so may the middles
    limit = away[:count].max() + radius / 10
    forces = np.zeros(len(probes))
    forces[:count] = loads**2 / total
    size, row = 0.0, count
    for i in range(count):
        for j in range(i + 1, count):
            share = loads[i] * loads[j] / total
            if away[row] <= limit:
                forces[row] = 2 * share
            else:
                # where they do not touch between two contacts, the contacts keep their shares
                forces[i] += share
                forces[j] += share
            size = max(size, np.sqrt(squared_distance(probes, i, probes, j)))
            row += 1
    touching = np.flatnonzero(forces)
    if len(touching) < len(probes):
        return probes[touching], forces[touching], radius, touching
    middle = np.zeros(3)
    for i in range(count):
        middle += loads[i] / total * probes[i]
    points, forces = _joined(middle + _INSET * (probes - middle), forces, size / 8)
    return points, forces, max(radius, _OVERLAP * size), np.full(len(forces), -1)


@numba.njit(cache=True, nogil=True)
def _joined(points, forces, near):
    """Force-weighted means and sums of the points, each joined with the first one that is near [m]."""
    means, totals, first = np.zeros_like(points), np.zeros_like(forces), np.empty(len(forces), np.int64)
    count = 0
    for i in range(len(forces)):
        owner = 0
        while owner < count and squared_distance(points, i, points, first[owner]) > near**2:
            owner += 1
        if owner == count:
            first[count] = i
            count += 1
        totals[owner] += forces[i]
        means[owner] += forces[i] * points[i]
    return means[:count] / totals[:count].copy().reshape(-1, 1), totals[:count]
