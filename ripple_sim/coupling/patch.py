"""Where a pair of bodies presses: contacts joined where they are near, filled in where they bound a flat patch."""

from __future__ import annotations

import dataclasses

import numba
import numpy as np
from numpy.typing import NDArray

MAX_CONTACTS = 8

# Nodes at the rim of a patch stand for half a cell, those at its corners for a quarter: their middles lie further in.
_INSET = 0.75
# Footprint radius over the patch's size, at which the footprints of the nodes of a square or a line just overlap.
_OVERLAP = 0.3


@numba.njit(cache=True)
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
            if owner[i] < 0 and _squared_distance(points, i, seed) <= radius**2:
                owner[i] = count
        seeds[count] = seed
        count += 1
    means, totals = np.zeros((count, 3)), np.zeros(count)
    for i in range(len(forces)):
        if owner[i] < 0:
            owner[i] = 0
            for j in range(1, count):
                if _squared_distance(points, i, seeds[j]) < _squared_distance(points, i, seeds[owner[i]]):
                    owner[i] = j
        totals[owner[i]] += forces[i]
        means[owner[i]] += forces[i] * points[i]
    for j in range(count):
        means[j] /= totals[j]
    return means, totals


@numba.njit(cache=True)
def _squared_distance(points, i, j):
    total = 0.0
    for k in range(3):
        total += (points[i, k] - points[j, k]) ** 2
    return total


@dataclasses.dataclass(frozen=True, eq=False)
class Pressed:
    """What presses on a target: 36 sources at most.

    Attributes
    ----------
    points : float64 [k, 3]
        Near the surface, in the target's frame [m].
    forces : float64 [k]
        [N].
    radius : float
        Footprint radius of each [m], which grows with the patch.
    probes : int64 [k] or None
        Which of the patch's probes the points are, if they are.
    """

    points: NDArray[np.float64]
    forces: NDArray[np.float64]
    radius: float
    probes: NDArray[np.int64] | None


class Patch:
    """The patch that the contacts of a pair bound.

    Contacts mark the corners of the patch. Between two of them a convex body touches as well, provided that the
    target's surface is there. The force is spread as the middle of two contacts drawn at random, each with a chance in
    proportion to its force: force and torque stay what they are, and four equal corners of a square, or two ends of
    a line, press evenly over it.

    Parameters
    ----------
    points : [k, 3]
        Contact points near the surface, in the target's frame [m].
    forces : [k]
        [N].
    radius : float
        Footprint radius of a single contact [m].
    convex : bool
        Whether the body is convex.

    Attributes
    ----------
    probes : float64 [m, 3]
        Points whose distances from the surface decide over the patch [m]: the corners, and the middles of all pairs.
    """

    def __init__(self, points: NDArray[np.float64], forces: NDArray[np.float64], radius: float, convex: bool) -> None:
        self._corners, self._loads = cluster(points, forces, radius)
        self._radius = radius
        self.probes = self._corners
        if convex and len(self._loads) > 1:
            self._first, self._second = np.triu_indices(len(self._loads), 1)
            middles = (self._corners[self._first] + self._corners[self._second]) / 2
            self.probes = np.concatenate([self._corners, middles])

    def pressed(self, surface: NDArray[np.float64]) -> Pressed:
        """What presses, told from the surface points nearest to `probes`."""
        corners, loads, radius, count = self._corners, self._loads, self._radius, len(self._loads)
        if len(self.probes) == count:
            return Pressed(corners, loads, radius, np.arange(count))
        away = np.linalg.norm(surface - self.probes, axis=1)
        # contact points lie a little outside of the surface, by up to their depth: so may the middles
        touching = away[count:] <= away[:count].max() + radius / 10
        share = loads[self._first] * loads[self._second] / loads.sum()
        # where they do not touch between two contacts, the contacts keep their shares
        kept = share * ~touching
        own = loads**2 / loads.sum() + np.bincount(self._first, kept, count) + np.bincount(self._second, kept, count)
        nodes = np.concatenate([np.arange(count), count + np.flatnonzero(touching)])
        weights = np.concatenate([own, 2 * share[touching]])
        if not touching.all():
            return Pressed(self.probes[nodes], weights, radius, nodes)
        size = float(np.linalg.norm(corners[self._first] - corners[self._second], axis=1).max())
        middle = loads @ corners / loads.sum()
        points, forces = _joined(middle + _INSET * (self.probes - middle), weights, size / 8)
        return Pressed(points, forces, max(radius, _OVERLAP * size), None)


def _joined(
    points: NDArray[np.float64], forces: NDArray[np.float64], near: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Force-weighted means and sums of the points, each joined with the first one that is near [m]."""
    close = np.linalg.norm(points[:, None] - points[None], axis=2) <= near
    _, owner = np.unique(close.argmax(axis=1), return_inverse=True)
    total = np.bincount(owner, forces).astype(np.float64)
    means = [np.bincount(owner, forces * points[:, axis]) / total for axis in range(3)]
    return np.stack(means, axis=1), total
