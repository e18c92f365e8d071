"""Contact patches: the points over which the force of each geom on a target is spread.

Contacts mark the corners of a patch. Between two of them a convex geom touches as well, provided
that the target's surface is there. The force is spread as the midpoint of two contacts drawn at
random, each with a probability in proportion to its force: force and torque stay the same, and four
equal corners of a square, or two ends of a line, spread it evenly. The texels round these points
are a geom's footprint, which is reused while its points stay.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel
from ripple_sim.solver.waves.footprint import weigh_each

# Up to so many contacts of a pair, what is convex presses between them too.
MAX_CORNERS = 8
# Points on the rim of a patch stand for half a cell, those at its corners for a quarter: their
# centres lie farther in.
_INSET = 0.75
# Footprint radius over the patch's size at which the footprints of the points of a square or a line
# just overlap.
_OVERLAP = 0.3

# A footprint is reused while its point moves by less than this share of a texel.
SAME_PLACE = 0.3


def load_points(
    points: Floats,
    forces: Floats,
    starts: Ints,
    radii: Floats,
    convex: Bools,
    closest: Callable[[Floats], Floats],
) -> tuple[Ints, Floats, Floats, Floats]:
    """Points that carry the forces of all patches on a target, patch by patch, 36 a patch at most.

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

    Returns
    -------
    patches : int64 [n]
        The patch of each, ascending.
    points : float64 [n, 3]
        Near the surface, in the target's frame [m].
    forces : float64 [n]
        [N].
    radii : float64 [n]
        Footprint radii [m].
    """
    if len(forces) == len(starts):
        return np.arange(len(starts)), points, forces, radii
    patches = np.zeros(len(forces), dtype=np.int64)
    patches[starts[1:]] = 1
    patches, points, forces = corners(patches.cumsum(), points, forces, radii)
    # all pairs of corners of a convex patch, [m, 2] in ascending order
    row = np.arange(len(patches))
    later = np.where(convex[patches], np.searchsorted(patches, patches, "right") - row - 1, 0)
    first = np.repeat(row, later)
    second = first + 1 + np.arange(len(first)) - np.repeat(later.cumsum() - later, later)
    pairs = np.column_stack([first, second])
    of_pair = patches[first]
    if not len(pairs):
        return patches, points, forces, radii[patches]
    probes = np.concatenate([points, (points[first] + points[second]) / 2])
    # contact points lie a little outside the surface, by up to their depth: so may the midpoints
    off = closest(probes) - probes
    away = np.sqrt(np.einsum("ij,ij->i", off, off))
    # the forces at the corners are shared among these and the midpoints
    total = np.bincount(patches, forces)
    (limit, size) = np.zeros((2, len(radii)))
    np.maximum.at(limit, patches, away[: len(points)])
    middles = (
        np.column_stack([np.bincount(patches, forces * each) for each in points.T]) / total[:, None]
    )
    np.maximum.at(size, of_pair, np.sqrt(((points[first] - points[second]) ** 2).sum(axis=1)))
    # where there is no touch between two corners, they keep their shares
    touch = away[len(points) :] <= (limit + radii / 10)[of_pair]
    filled = np.zeros(len(radii), np.bool_)
    filled[of_pair] = True
    filled[of_pair[~touch]] = False
    share = forces[first] * forces[second] / total[of_pair]
    shares = np.concatenate([forces, np.where(touch, 2 * share, 0.0)])
    shares[pairs] = forces[pairs] ** 2 / total[patches[pairs]]
    np.add.at(shares, pairs[~touch].ravel(), np.repeat(share[~touch], 2))
    # what carries a force: of each patch its corners, then the midpoints
    kept = shares.nonzero()[0]
    of = np.concatenate([patches, of_pair])
    kept = kept[of[kept].argsort(kind="stable")]
    of = of[kept]
    # the points of a patch that is filled stand for the cells of a lattice, and are joined where
    # they are near
    inset = np.where(filled, _INSET, 1.0)[of, None]
    near = np.where(filled, size / 8, 0.0)
    lattice = inset * probes[kept] + (1 - inset) * middles[of]
    patches, points, forces = _joined(of, lattice, shares[kept], near, len(kept))
    return (
        patches,
        points,
        forces,
        np.where(filled, np.maximum(radii, _OVERLAP * size), radii)[patches],
    )


def corners(
    patches: Ints, points: Floats, forces: Floats, radii: Floats
) -> tuple[Ints, Floats, Floats]:
    """Join contacts within a radius [m] of the strongest of their patch: patches, force-weighted points, summed forces.

    Contacts farther apart (the two ends of a capsule) stay apart, up to eight corners; then the
    rest joins the nearest. The forces of the corners add up to those of the patch.

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


def _joined(
    patches: Ints, points: Floats, forces: Floats, near: Floats, most: int
) -> tuple[Ints, Floats, Floats]:
    """Points of each patch joined with the first one near them that is a seed: force-weighted, with summed forces.

    A point is a seed unless one of its patch that is a seed of its own comes before. `near` are the
    distances of the patches [m]. After so many seeds of a patch the rest joins the nearest of them.
    """
    # made here: kernels that allocate take longer to compile
    of = np.empty_like(patches)
    at = np.empty_like(points)
    totals = np.empty_like(forces)
    found = _join(patches, points, forces, near, most, np.empty_like(patches), of, at, totals)
    return of[:found], at[:found], totals[:found]


@kernel
def _join(
    patches: Ints, points: Floats, forces: Floats, near: Floats, most: int,
    seeds: Ints, of: Ints, at: Floats, totals: Floats,
) -> int:  # fmt: skip
    """Fill in the seeds, their patches, points and forces; how many there are."""
    found = 0
    begin = 0
    for i in range(len(patches)):
        if found > 0 and of[found - 1] != patches[i]:
            begin = found
        joins = -1
        nearest = -1
        least = np.inf
        for row in range(begin, found):
            distance2 = 0.0
            for k in range(3):
                distance2 += (points[i, k] - points[seeds[row], k]) ** 2
            if distance2 < least:
                nearest = row
                least = distance2
            if joins < 0 and distance2 <= near[patches[i]] ** 2:
                joins = row
        if joins < 0 and found - begin == most:
            joins = nearest
        if joins < 0:
            seeds[found] = i
            of[found] = patches[i]
            totals[found] = forces[i]
            for k in range(3):
                at[found, k] = points[i, k]
            found += 1
        else:
            totals[joins] += forces[i]
            for k in range(3):
                at[joins, k] += forces[i] / totals[joins] * (points[i, k] - at[joins, k])
    return found


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
        # geoms, points, radii as they were asked for, and how far these two may move before one is
        # made anew [m]
        self._made: tuple[NDArray, ...] = (
            np.zeros(0, np.int64),
            np.zeros((0, 3)),
            np.zeros(0),
            np.zeros(0),
        )
        # of each, as `under` gives them
        self._under: list[tuple[Ints, Floats]] = []

    def follow(self, atlas: Atlas) -> None:
        """Go on where the surface is now: footprints ride on their texels."""
        first = [texels[0] for texels, _ in self._under]
        before = self._grid.positions
        self._place_on(atlas)
        geoms, points, *sizes = self._made
        self._made = geoms, points + self._grid.positions[first] - before[first], *sizes

    def _place_on(self, atlas: Atlas) -> None:
        self._atlas = atlas
        self._grid = atlas.texels.grid
        self._movable_area = self._grid.areas * self._movable

    def under(
        self, geoms: Ints, points: Floats, radii: Floats, active: Bools
    ) -> list[tuple[Ints, Floats]]:
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
            Geoms that touch, have lost touch only now, or have yet to give an impulse: their
            footprints are kept.
        """
        rows = np.full(len(geoms) + len(self._under), -1)
        touching = np.zeros(len(active), np.bool_)
        rows = rows[: _serving(geoms, points, radii, *self._made, active, touching, rows)]
        new = (rows < 0).nonzero()[0]
        rows[new] = len(self._under) + np.arange(len(new))
        under = self._under
        tolerances = np.zeros(0)
        if len(new):
            grid = self._grid
            places, centres = self._atlas.nearest_places(points[new])
            begins, texels, weights, _ = weigh_each(grid, centres, places, radii[new])
            shares = weights * self._movable_area[texels]
            ends = itertools.pairwise(begins.tolist())
            under = [*under, *((texels[first:last], shares[first:last]) for first, last in ends)]
            tolerances = SAME_PLACE * np.sqrt(grid.areas[centres])
        self._under = [under[row] for row in rows.tolist()]
        added = geoms[new], points[new], radii[new], tolerances
        self._made = tuple(
            np.concatenate(each)[rows] for each in zip(self._made, added, strict=True)
        )
        return self._under[: len(geoms)]


@kernel
def _serving(
    geoms: Ints, points: Floats, radii: Floats, made: Ints, at: Floats, sizes: Floats, near: Floats, active: Bools,
    touching: Bools, rows: Ints,
) -> int:  # fmt: skip
    """Fill in the first footprint that serves each load point, and then those that are only kept; how many there are.

    Parameters
    ----------
    geoms, points, radii
        Of the load points.
    made, at, sizes, near
        Geoms, points, radii and tolerances of the footprints.
    active
        Geoms whose footprints are kept.
    touching : bool [c]
        Scratch, False.
    rows : int64 [n + m]
        -1, which stays where none serves.
    """
    count = len(geoms)
    for i in range(len(geoms)):
        touching[geoms[i]] = True
        for row in range(len(made)):
            if made[row] == geoms[i] and rows[i] < 0:
                distance2 = 0.0
                for k in range(3):
                    distance2 += (at[row, k] - points[i, k]) ** 2
                if np.sqrt(distance2) <= near[row] and abs(sizes[row] - radii[i]) <= near[row]:
                    rows[i] = row
    for row in range(len(made)):
        if active[made[row]] and not touching[made[row]]:
            rows[count] = row
            count += 1
    return count
