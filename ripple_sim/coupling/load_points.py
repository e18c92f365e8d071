"""The points over which the force of one contact patch is spread.

Contacts mark the corners of the patch. Between two of them a convex geom touches as well, provided that the target's
surface is there. The force is spread as the midpoint of two contacts drawn at random, each with a probability in
proportion to its force: force and torque stay the same, and four equal corners of a square, or two ends of a line,
spread it evenly.
"""

from __future__ import annotations

import numpy as np

from ripple_sim.solver.kernel import Floats, Ints, kernel

from .clusters import cluster, merge_near, squared_distance

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
