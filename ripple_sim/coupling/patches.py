"""Contact patches: the points over which the force of each geom on a target is spread.

Contacts mark the corners of a patch. Between two of them a convex geom touches as well, provided that the target's
surface is there. The force is spread as the midpoint of two contacts drawn at random, each with a probability in
proportion to its force: force and torque stay the same, and four equal corners of a square, or two ends of a line,
spread it evenly.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel

MAX_CORNERS = 8
# Points on the rim of a patch stand for half a cell, those at its corners for a quarter: their centres lie farther in.
_INSET = 0.75
# Footprint radius over the patch's size at which the footprints of the points of a square or a line just overlap.
_OVERLAP = 0.3


class LoadPoints(NamedTuple):
    """Points that carry the forces of the patches, patch by patch, 36 a patch at most.

    Attributes
    ----------
    patches : int64 [n]
        The patch of each, ascending.
    points : float64 [n, 3]
        Near the surface, in the target's frame [m].
    forces : float64 [n]
        [N].
    radii : float64 [n]
        Footprint radii [m].
    """

    patches: Ints
    points: Floats
    forces: Floats
    radii: Floats


def load_points(
    points: Floats,
    forces: Floats,
    starts: Ints,
    radii: Floats,
    convex: Bools,
    closest: Callable[[Floats], Floats],
) -> LoadPoints:
    """Points that carry the forces of all patches on a target.

    Parameters
    ----------
    points : float64 [k, 3]
        Contact points near the surface, patch by patch, in the target's frame [m].
    forces : float64 [k]
        All of one sign within a patch [N].
    starts : int64 [p]
        The first contact of each patch.
    radii : float64 [p]
        Footprint radius of a single contact with each geom [m].
    convex : bool [p]
        Whether the geom that touches is.
    closest : callable
        Surface points [m], [q, 3], nearest to points [q, 3].
    """
    if len(forces) == len(starts):
        return LoadPoints(np.arange(len(starts)), points, forces, radii)
    patches = np.zeros(len(forces), dtype=np.int64)
    patches[starts[1:]] = 1
    patches, points, forces = corners(patches.cumsum(), points, forces, radii)
    counts = np.bincount(patches)
    wide = convex & (counts > 1)
    if not wide.any():
        return LoadPoints(patches, points, forces, radii[patches])
    return _spread(patches, points, forces, counts, wide, radii, closest)


def _spread(
    patches: Ints, points: Floats, forces: Floats, counts: Ints, wide: Bools, radii: Floats,
    closest: Callable[[Floats], Floats],
) -> LoadPoints:  # fmt: skip
    """Spread the forces at the corners of patches, some of which are wide: touched between their corners too."""
    total, is_wide = np.bincount(patches, forces), wide[patches]
    first, second = _pairs(np.where(is_wide, np.cumsum(counts)[patches] - np.arange(len(patches)) - 1, 0))
    of_pair, between = patches[first], (points[first] + points[second]) / 2
    shares, distances = forces[first] * forces[second] / total[of_pair], _length(points[first] - points[second])
    # contact points lie a little outside the surface, by up to their depth: so may the midpoints
    probes = np.concatenate([points, between])
    away, limit = _length(closest(probes) - probes), np.zeros(len(wide))
    np.maximum.at(limit, patches, away[: len(patches)])
    touching = away[len(patches) :] <= (limit + radii / 10)[of_pair]
    # where there is no touch between two corners, they keep their shares
    kept = np.where(touching, 0.0, shares)
    at_corners = np.where(is_wide, forces**2 / total[patches], forces)
    at_corners += np.bincount(first, kept, len(forces)) + np.bincount(second, kept, len(forces))
    # where all touch, the points stand for the cells of a lattice
    size, filled = np.zeros(len(wide)), wide.copy()
    np.maximum.at(size, of_pair, distances)
    filled[of_pair[~touching]] = False
    middles = _sums(patches, forces[:, None] * points) / total[:, None]
    patches = np.concatenate([patches, of_pair[touching]])
    order = np.argsort(patches, kind="stable")
    patches, points = patches[order], np.concatenate([points, between[touching]])[order]
    forces = np.concatenate([at_corners, 2 * shares[touching]])[order]
    if filled.any():
        inset = np.where(filled, _INSET, 1.0)[patches, None]
        points = inset * points + (1 - inset) * middles[patches]
        patches, points, forces = _joined(patches, points, forces, np.where(filled, size / 8, 0.0), len(points))
        radii = np.where(filled, np.maximum(radii, _OVERLAP * size), radii)
    return LoadPoints(patches, points, forces, radii[patches])


def corners(patches: Ints, points: Floats, forces: Floats, radii: Floats) -> tuple[Ints, Floats, Floats]:
    """Join contacts within a radius [m] of the strongest of their patch: patches, force-weighted points, summed forces.

    Contacts farther apart (the two ends of a capsule) stay apart, up to eight corners; then the rest joins the nearest.
    The forces of the corners add up to those of the patch.

    Parameters
    ----------
    patches : int64 [k]
        Ascending.
    points : float64 [k, 3]
        [m].
    forces : float64 [k]
        All of one sign within a patch [N].
    radii : float64 [p]
        Of each patch.
    """
    strongest_first = np.lexsort((-np.abs(forces), patches))
    return _joined(patches, points[strongest_first], forces[strongest_first], radii, MAX_CORNERS)


def _pairs(followers: Ints) -> tuple[Ints, Ints]:
    """All pairs of a row with one of those that follow it, of which each has so many."""
    first = np.repeat(np.arange(len(followers)), followers)
    before = np.cumsum(followers) - followers
    return first, first + 1 + np.arange(len(first)) - np.repeat(before, followers)


def _joined(patches: Ints, points: Floats, forces: Floats, near: Floats, most: int) -> tuple[Ints, Floats, Floats]:
    """Points of each patch joined with the first one near them; see `_seeds`."""
    seeds = _seeds(patches, points, near, most)
    found = np.flatnonzero(seeds == np.arange(len(seeds)))
    if len(found) == len(seeds):
        return patches, points, forces
    number = np.searchsorted(found, seeds)
    totals = np.bincount(number, forces).astype(np.float64, copy=False)
    return patches[found], _sums(number, forces[:, None] * points) / totals[:, None], totals


@kernel
def _seeds(patches: Ints, points: Floats, near: Floats, most: int) -> Ints:
    """The first point of its patch near each point [k]: itself, unless one that is a seed of its own comes before.

    `near` are the distances of the patches [m]. After so many seeds of a patch the rest joins the nearest of them.
    """
    seeds, begin, count = np.empty(len(patches), np.int64), 0, 0
    for i in range(len(patches)):
        if patches[i] != patches[begin]:
            begin, count = i, 0
        seeds[i], nearest, least = -1, i, np.inf
        for j in range(begin, i):
            if seeds[j] == j and seeds[i] < 0:
                distance2 = 0.0
                for k in range(3):
                    distance2 += (points[i, k] - points[j, k]) ** 2
                if distance2 < least:
                    nearest, least = j, distance2
                if distance2 <= near[patches[i]] ** 2:
                    seeds[i] = j
        if seeds[i] < 0 and count < most:
            seeds[i] = i
            count += 1
        elif seeds[i] < 0:
            seeds[i] = nearest
    return seeds


def _sums(groups: Ints, vectors: Floats) -> Floats:
    """Sums of vectors [k, 3] by group."""
    return np.stack([np.bincount(groups, vectors[:, k]) for k in range(3)], axis=1)


def _length(vectors: Floats) -> Floats:
    return np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
