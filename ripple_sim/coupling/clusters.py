"""Contacts joined where they are near each other: the corners of a contact patch."""

from __future__ import annotations

import numpy as np

from ripple_sim.solver.kernel import Floats, kernel

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
