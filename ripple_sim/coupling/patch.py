"""Where a pair of bodies presses: contacts joined where they are near, filled in where they bound a flat patch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas

Sources = tuple[NDArray[np.float64], NDArray[np.float64], float]

MAX_CONTACTS = 8

# Nodes at the rim of a patch stand for half a cell, those at its corners for a quarter: their middles lie further in.
_INSET = 0.75
# Footprint radius over the patch's size, at which the footprints of the nodes of a square or a line just overlap.
_OVERLAP = 0.3


def cluster(
    points: NDArray[np.float64], forces: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Join contacts that lie within a radius [m] of the strongest one: force-weighted points and summed forces.

    What lies farther apart (the two ends of a capsule) stays apart, up to eight clusters; then the rest goes to the
    nearest. The forces of the clusters add up to the total.

    Parameters
    ----------
    points : [k, 3]
    forces : [k]
        Positive.
    """
    owner = np.full(len(forces), -1)
    seeds: list[int] = []
    while (owner < 0).any() and len(seeds) < MAX_CONTACTS:
        left = np.flatnonzero(owner < 0)
        seed = int(left[np.argmax(forces[left])])
        near = left[np.linalg.norm(points[left] - points[seed], axis=1) <= radius]
        owner[near] = len(seeds)
        seeds.append(seed)
    for i in np.flatnonzero(owner < 0):
        owner[i] = int(np.argmin(np.linalg.norm(points[seeds] - points[i], axis=1)))
    return _joined(points, forces, owner)


def pressed_patch(
    atlas: Atlas, points: NDArray[np.float64], forces: NDArray[np.float64], radius: float, convex: bool
) -> Sources:
    """Spread the forces of a pair's contacts over the patch that they bound.

    Contacts mark the corners of the patch. Between two of them a convex body touches as well, provided that the
    target's surface is there. The force is spread as the middle of two contacts drawn at random, each with a chance in
    proportion to its force: force and torque stay what they are, and four equal corners of a square, or two ends of
    a line, press evenly over it.

    Parameters
    ----------
    atlas : Atlas
        Of the target.
    points : [k, 3]
        Contact points near the surface, in the target's frame [m].
    forces : [k]
        [N].
    radius : float
        Footprint radius of a single contact [m].
    convex : bool
        Whether the body is convex.

    Returns
    -------
    points, forces, radius
        At most 36 sources, and their footprint radius, which grows with the patch.
    """
    corners, loads = cluster(points, forces, radius)
    count = len(loads)
    if count == 1 or not convex:
        return corners, loads, radius
    first, second = np.triu_indices(count, 1)
    between = (corners[first] + corners[second]) / 2
    surface, _ = atlas.project(np.concatenate([corners, between]))
    # contact points lie a little outside of the surface, by up to their depth: so may the middles
    depth = np.linalg.norm(surface[:count] - corners, axis=1).max()
    touching = np.linalg.norm(surface[count:] - between, axis=1) <= depth + radius / 10
    share = loads[first] * loads[second] / loads.sum()
    # where they do not touch between two contacts, the contacts keep their shares
    kept = share * ~touching
    own = loads**2 / loads.sum() + np.bincount(first, kept, count) + np.bincount(second, kept, count)
    nodes = np.concatenate([corners, between[touching]])
    weights = np.concatenate([own, 2 * share[touching]])
    if not touching.all():
        return nodes, weights, radius
    size = float(np.linalg.norm(corners[first] - corners[second], axis=1).max())
    middle = loads @ corners / loads.sum()
    radius = max(radius, _OVERLAP * size)
    nodes = middle + _INSET * (nodes - middle)
    near = np.linalg.norm(nodes[:, None] - nodes[None], axis=2) <= size / 8
    return *_joined(nodes, weights, near.argmax(axis=1)), radius


def _joined(
    points: NDArray[np.float64], forces: NDArray[np.float64], owner: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Force-weighted means and sums of the points that have the same owner."""
    _, owner = np.unique(owner, return_inverse=True)
    total = np.bincount(owner, forces).astype(np.float64)
    means = [np.bincount(owner, forces * points[:, axis]) / total for axis in range(3)]
    return np.stack(means, axis=1), total
