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
    count = len(corner_forces)
    if len(probes) == count:
        return probes, corner_forces, radius, np.arange(count)
    forces, size = _probe_forces(corner_forces, probes, surface, radius)
    touching = np.flatnonzero(forces)
    if len(touching) < len(probes):
        return probes[touching], forces[touching], radius, touching
    total, middle = corner_forces.sum(), np.zeros(3)
    for i in range(count):
        for k in range(3):
            middle[k] += corner_forces[i] / total * probes[i, k]
    inset = np.empty_like(probes)
    for i in range(len(probes)):
        for k in range(3):
            inset[i, k] = middle[k] + _INSET * (probes[i, k] - middle[k])
    points, forces = merge_near(inset, forces, size / 8)
    return points, forces, max(radius, _OVERLAP * size), np.full(len(forces), -1)


@kernel
def _probe_forces(corner_forces: Floats, probes: Floats, surface: Floats, radius: float) -> tuple[Floats, float]:
    """Forces at the probes [N], [q], 0 for midpoints off the surface, and the size of the patch [m]."""
    count, total = len(corner_forces), corner_forces.sum()
    away = np.array([np.sqrt(squared_distance(surface, i, probes, i)) for i in range(len(probes))])
    # contact points lie a little outside the surface, by up to their depth: so may the midpoints
    limit = away[:count].max() + radius / 10
    forces = np.zeros(len(probes))
    for i in range(count):
        forces[i] = corner_forces[i] ** 2 / total
    size, row = 0.0, count
    for i in range(count):
        for j in range(i + 1, count):
            share = corner_forces[i] * corner_forces[j] / total
            if away[row] <= limit:
                forces[row] = 2 * share
            else:
                # where there is no touch between two corners, they keep their shares
                forces[i] += share
                forces[j] += share
            size = max(size, np.sqrt(squared_distance(probes, i, probes, j)))
            row += 1
    return forces, size
