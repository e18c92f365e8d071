"""Contact patches: the points over which the force of each geom on a target is spread.

Contacts mark the corners of a patch. Between two of them a convex geom touches as well, provided that the target's
surface is there. The force is spread as the midpoint of two contacts drawn at random, each with a probability in
proportion to its force: force and torque stay the same, and four equal corners of a square, or two ends of a line,
spread it evenly.
The texels round these points are a geom's footprint, which is reused while its points stay.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel
from ripple_sim.solver.texels.chart_map import nearest_places
from ripple_sim.solver.texels.distance import distance_scratch
from ripple_sim.solver.waves.footprint import weigh

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


# A footprint is reused while its point moves by less than this share of a texel.
_SAME_PLACE = 0.3


class Footprints:
    """The texels that carry the forces of load points, and their shares.

    Parameters
    ----------
    atlas : Atlas
        Of the target.
    movable : bool [C n n]
        Whether loads move a texel.
    """

    def __init__(self, atlas: Atlas, movable: NDArray[np.bool_]) -> None:
        self._movable = movable
        self._place_on(atlas)
        self._geoms, self._points = np.zeros(0, np.int64), np.zeros((0, 3))
        # radii as they were asked for, and how far point and radius may move before a footprint is made anew [m]
        self._radii, self._tolerances = np.zeros(0), np.zeros(0)
        # of each, as `under` gives them
        self._under: list[tuple[Ints, Floats]] = []

    def follow(self, atlas: Atlas) -> None:
        """Go on where the surface is now: footprints ride on their texels."""
        first, before = [texels[0] for texels, _ in self._under], self._grid.positions
        self._place_on(atlas)
        self._points = self._points + self._grid.positions[first] - before[first]

    def _place_on(self, atlas: Atlas) -> None:
        self._surface, self._grid = atlas.places, atlas.texels.grid
        self._movable_area = self._grid.areas * self._movable

    def under(self, geoms: Ints, points: Floats, radii: Floats, active: Bools) -> list[tuple[Ints, Floats]]:
        """Texels under load points, and their shares of a unit force there: 1 in all, or less where some are fixed.

        Parameters
        ----------
        geoms : int64 [n]
            Ids of the geoms that touch, ascending.
        points : float64 [n, 3]
            In the target's frame [m].
        radii : float64 [n]
            [m].
        active : bool [c]
            Geoms that touch, have lost touch only now, or have yet to give an impulse: their footprints are kept.
        """
        made = self._geoms, self._points, self._radii, self._tolerances
        rows = _serving(geoms, points, radii, *made, active)
        new = (rows < 0).nonzero()[0]
        rows[new] = len(self._geoms) + np.arange(len(new))
        under, tolerances = self._make(points[new], radii[new]) if len(new) else ([], np.zeros(0))
        all_under = [*self._under, *under]
        self._under = [all_under[row] for row in rows.tolist()]
        self._geoms = np.concatenate([self._geoms, geoms[new]])[rows]
        self._points = np.concatenate([self._points, points[new]])[rows]
        self._radii = np.concatenate([self._radii, radii[new]])[rows]
        self._tolerances = np.concatenate([self._tolerances, tolerances])[rows]
        return self._under[: len(geoms)]

    def _make(self, points: Floats, radii: Floats) -> tuple[list[tuple[Ints, Floats]], Floats]:
        """New footprints, and how far they may be from their points [m]."""
        grid, scratch = self._grid, distance_scratch(len(self._movable))
        places, centres = nearest_places(self._surface, points)
        under = []
        for place, centre, radius in zip(places, centres.tolist(), radii.tolist(), strict=True):
            texels, weights, _ = weigh(grid, centre, place, radius, scratch)
            under.append((texels, weights * self._movable_area[texels]))
        return under, _SAME_PLACE * np.sqrt(grid.areas[centres])


@kernel
def _serving(
    geoms: Ints, points: Floats, radii: Floats, made: Ints, at: Floats, sizes: Floats, near: Floats, active: Bools
) -> Ints:
    """The first footprint that serves each load point, -1 where none does, and then those that are only kept.

    Parameters
    ----------
    geoms, points, radii
        Of the load points.
    made, at, sizes, near
        Geoms, points, radii and tolerances of the footprints.
    active
        Geoms whose footprints are kept.
    """
    count = len(geoms)
    rows, touching = np.full(count + len(made), -1), np.zeros(len(active), np.bool_)
    for i in range(len(geoms)):
        touching[geoms[i]] = True
        for row in range(len(made)):
            if made[row] == geoms[i] and rows[i] < 0:
                distance2 = 0.0
                for k in range(3):
                    distance2 += (at[row, k] - points[i, k]) ** 2
                if max(np.sqrt(distance2), abs(sizes[row] - radii[i])) <= near[row]:
                    rows[i] = row
    for row in range(len(made)):
        if active[made[row]] and not touching[made[row]]:
            rows[count] = row
            count += 1
    return rows[:count]
