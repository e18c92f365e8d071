"""Contact patches: the points over which the force of each geom on a target is spread.

Contacts mark the corners of a patch. Between two of them a convex geom touches as well, provided
that the target's surface is there. The force is spread over corners and midpoints as if the place
were the midpoint of two contacts drawn at random, each with a probability in proportion to its
force. So force and torque stay the same, and four equal corners of a square, or two ends of a line,
spread the force evenly. The texels round these points are a geom's footprint, which is reused while
its points stay.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel
from ripple_sim.solver.waves.footprint import weigh_each

# A patch has at most so many corners; a convex geom presses between them too.
MAX_CORNERS = 8
# Distance from the middle of a patch to the cell of a point, over the distance to the point. Points
# on the rim of a patch stand for half a cell, and points at its corners for a quarter: the centres
# of these cells lie farther in.
_INSET = 0.75
# Points of a patch that is filled are joined where they are nearer than this share of its size.
_JOINED_SHARE = 1 / 8
# Between two corners the surface may be farther off than at the corners, by the footprint radius
# over this, and still be touched.
_TOUCH_DIVISOR = 10
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
    """Points that carry the forces of all patches on a target, patch by patch.

    A patch has 36 points at most: its corners and the midpoints between them.

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
        Whether the geom that touches is convex.
    closest : callable
        Surface points [m], [q, 3], nearest to points [q, 3].

    Returns
    -------
    patches : int64 [n]
        The patch of each point, ascending.
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
    first, second = _pairs_of_corners(patches, convex)
    if not len(first):
        return patches, points, forces, radii[patches]
    pair_patches = patches[first]
    # corners, then midpoints
    candidates = np.concatenate([points, (points[first] + points[second]) / 2])
    candidate_patches = np.concatenate([patches, pair_patches])
    # contact points lie a little outside the surface, by up to their depth: so may the midpoints
    offsets = closest(candidates) - candidates
    distances = np.sqrt(np.einsum("ij,ij->i", offsets, offsets))
    corner_distance = np.zeros(len(radii))  # the greatest of each patch [m]
    np.maximum.at(corner_distance, patches, distances[: len(points)])
    touch = distances[len(points) :] <= (corner_distance + radii / _TOUCH_DIVISOR)[pair_patches]
    total = np.bincount(patches, forces).astype(np.float64)  # force of each patch [N]
    shares = _shared_forces(patches, forces, total, np.column_stack([first, second]), touch)
    # a patch is filled if it has midpoints, and the surface is there at all of them
    is_filled = np.zeros(len(radii), np.bool_)
    is_filled[pair_patches] = True
    is_filled[pair_patches[~touch]] = False
    size = np.zeros(len(radii))  # of each patch, the longest distance between two corners [m]
    diagonals = np.sqrt(((points[first] - points[second]) ** 2).sum(axis=1))
    np.maximum.at(size, pair_patches, diagonals)
    # the points that carry a force, patch by patch: the corners, then the midpoints
    rows = shares.nonzero()[0]
    rows = rows[candidate_patches[rows].argsort(kind="stable")]
    row_patches = candidate_patches[rows]
    # the points of a patch that is filled stand for the cells of a lattice, and are joined where
    # they are near
    weighted_sums = [np.bincount(patches, forces * coordinate) for coordinate in points.T]
    middles = np.column_stack(weighted_sums) / total[:, None]  # of each patch [m]
    inset = np.where(is_filled, _INSET, 1.0)[row_patches, None]
    lattice = inset * candidates[rows] + (1 - inset) * middles[row_patches]
    joined_within = np.where(is_filled, size * _JOINED_SHARE, 0.0)
    patches, points, forces = _joined(row_patches, lattice, shares[rows], joined_within, len(rows))
    patch_radii = np.where(is_filled, np.maximum(radii, _OVERLAP * size), radii)
    return patches, points, forces, patch_radii[patches]


def _pairs_of_corners(patches: Ints, convex: Bools) -> tuple[Ints, Ints]:
    """All pairs of corners of convex patches, in ascending order, [m] and [m].

    Parameters
    ----------
    patches : int64 [k]
        The patch of each corner, ascending.
    convex : bool [p]
    """
    corner = np.arange(len(patches))
    # how many later corners the patch of a corner has
    patch_ends = np.searchsorted(patches, patches, "right")
    later_corners = np.where(convex[patches], patch_ends - corner - 1, 0)
    first = np.repeat(corner, later_corners)
    first_pairs = np.repeat(later_corners.cumsum() - later_corners, later_corners)
    second = first + 1 + np.arange(len(first)) - first_pairs
    return first, second


def _shared_forces(
    patches: Ints, forces: Floats, total: Floats, pairs: Ints, touch: Bools
) -> Floats:
    """Forces of the corners, shared among corners and midpoints [N], [k + m].

    Where there is no touch between two corners, they keep the share of their midpoint.

    Parameters
    ----------
    patches : int64 [k]
        The patch of each corner, ascending.
    forces : float64 [k]
        Of the corners [N].
    total : float64 [p]
        Force of each patch [N].
    pairs : int64 [m, 2]
        The two corners of each midpoint.
    touch : bool [m]
        Whether the surface is at the midpoint.
    """
    first, second = pairs.T
    half_share = forces[first] * forces[second] / total[patches[first]]
    shares = np.concatenate([forces, np.where(touch, 2 * half_share, 0.0)])
    shares[pairs] = forces[pairs] ** 2 / total[patches[pairs]]
    np.add.at(shares, pairs[~touch].ravel(), np.repeat(half_share[~touch], 2))
    return shares


def corners(
    patches: Ints, points: Floats, forces: Floats, radii: Floats
) -> tuple[Ints, Floats, Floats]:
    """Join contacts within a radius of the strongest contact of their patch.

    Contacts farther apart (the two ends of a capsule) stay apart, up to eight corners; all further
    contacts join the nearest corner. The forces of the corners add up to those of the patch.

    Parameters
    ----------
    patches : int64 [k]
        Ascending.
    points : float64 [k, 3]
        [m].
    forces : float64 [k]
        All of one sign within a patch [N].
    radii : float64 [p]
        Of each patch [m].

    Returns
    -------
    patches : int64 [n]
        The patch of each corner, ascending.
    points : float64 [n, 3]
        Force-weighted [m].
    forces : float64 [n]
        Summed [N].
    """
    strongest_first = np.lexsort((-np.abs(forces), patches))
    return _joined(patches, points[strongest_first], forces[strongest_first], radii, MAX_CORNERS)


def _joined(
    patches: Ints, points: Floats, forces: Floats, within: Floats, max_seeds: int
) -> tuple[Ints, Floats, Floats]:
    """Join the points of each patch with the first seed near them; see `corners` for the result.

    A point is a seed unless a seed of its patch is near and comes before it.

    Parameters
    ----------
    patches, points, forces
        See `corners`.
    within : float64 [p]
        Distance within which the points of a patch are joined [m].
    max_seeds : int
        Largest number of seeds of a patch; further points join the nearest seed.
    """
    # allocated here: kernels that allocate take longer to compile
    seeds = _Seeds(
        rows=np.empty_like(patches),
        patches=np.empty_like(patches),
        points=np.empty_like(points),
        forces=np.empty_like(forces),
    )
    count = _join(patches, points, forces, within, max_seeds, seeds)
    return seeds.patches[:count], seeds.points[:count], seeds.forces[:count]


class _Seeds(NamedTuple):
    """Points with which other points are joined, patch by patch.

    Attributes
    ----------
    rows : int64 [k]
        Among all points.
    patches : int64 [k]
    points : float64 [k, 3]
        Force-weighted means of the seed and the points joined with it [m].
    forces : float64 [k]
        Their sums [N].
    """

    rows: Ints
    patches: Ints
    points: Floats
    forces: Floats


@kernel
def _join(
    patches: Ints, points: Floats, forces: Floats, within: Floats, max_seeds: int, seeds: _Seeds
) -> int:
    """Fill in the seeds; return their number."""
    count = 0
    begin = 0
    for i in range(len(patches)):
        if count > 0 and seeds.patches[count - 1] != patches[i]:
            begin = count
        joins = -1
        nearest = -1
        least = np.inf
        for row in range(begin, count):
            distance2 = 0.0
            for k in range(3):
                distance2 += (points[i, k] - points[seeds.rows[row], k]) ** 2
            if distance2 < least:
                nearest = row
                least = distance2
            if joins < 0 and distance2 <= within[patches[i]] ** 2:
                joins = row
        if joins < 0 and count - begin == max_seeds:
            joins = nearest
        if joins < 0:
            seeds.rows[count] = i
            seeds.patches[count] = patches[i]
            seeds.forces[count] = forces[i]
            for k in range(3):
                seeds.points[count, k] = points[i, k]
            count += 1
        else:
            seeds.forces[joins] += forces[i]
            weight = forces[i] / seeds.forces[joins]
            for k in range(3):
                seeds.points[joins, k] += weight * (points[i, k] - seeds.points[joins, k])
    return count


class _Keys(NamedTuple):
    """The load points for which footprints were made, one for each footprint.

    Attributes
    ----------
    geoms : int64 [m]
    points : float64 [m, 3]
        Load points in the target's frame [m].
    radii : float64 [m]
        [m].
    tolerances : float64 [m]
        How far point and radius may change before another footprint is made [m].
    """

    geoms: Ints
    points: Floats
    radii: Floats
    tolerances: Floats


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
        self._keys = _Keys(
            geoms=np.zeros(0, np.int64),
            points=np.zeros((0, 3)),
            radii=np.zeros(0),
            tolerances=np.zeros(0),
        )
        # texels and shares of each footprint
        self._footprints: list[tuple[Ints, Floats]] = []

    def follow(self, atlas: Atlas) -> None:
        """Go on with the surface as it is now: footprints ride on their texels."""
        first_texels = [texels[0] for texels, _ in self._footprints]
        positions_before = self._grid.positions[first_texels]
        self._place_on(atlas)
        points = self._keys.points + self._grid.positions[first_texels] - positions_before
        self._keys = self._keys._replace(points=points)

    def _place_on(self, atlas: Atlas) -> None:
        """Take the geometry of an atlas."""
        self._atlas = atlas
        self._grid = atlas.texels.grid
        self._movable_area = self._grid.areas * self._movable

    def under(
        self, geoms: Ints, points: Floats, radii: Floats, active: Bools
    ) -> list[tuple[Ints, Floats]]:
        """Texels under each load point, and their shares of a unit force there.

        The shares add up to 1, or to less where texels are fixed.

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
        rows = np.full(len(geoms) + len(self._footprints), -1)
        touching = np.zeros(len(active), np.bool_)
        count = _serving(geoms, points, radii, self._keys, active, touching, rows)
        rows = rows[:count]
        new = (rows < 0).nonzero()[0]
        rows[new] = len(self._footprints) + np.arange(len(new))
        footprints = self._footprints
        tolerances = np.zeros(0)
        if len(new):
            grid = self._grid
            places, centres = self._atlas.nearest_places(points[new])
            begins, texels, weights, _ = weigh_each(grid, centres, places, radii[new])
            shares = weights * self._movable_area[texels]
            footprints = list(footprints)
            for first, last in itertools.pairwise(begins.tolist()):
                footprints.append((texels[first:last], shares[first:last]))
            tolerances = SAME_PLACE * np.sqrt(grid.areas[centres])
        self._footprints = [footprints[row] for row in rows.tolist()]
        keys = self._keys
        self._keys = _Keys(
            geoms=np.concatenate([keys.geoms, geoms[new]])[rows],
            points=np.concatenate([keys.points, points[new]])[rows],
            radii=np.concatenate([keys.radii, radii[new]])[rows],
            tolerances=np.concatenate([keys.tolerances, tolerances])[rows],
        )
        return self._footprints[: len(geoms)]


@kernel
def _serving(
    geoms: Ints,
    points: Floats,
    radii: Floats,
    keys: _Keys,
    active: Bools,
    touching: Bools,
    rows: Ints,
) -> int:
    """Find the row of the first footprint that serves each load point, and of those that are kept.

    Returns the number of load points and kept footprints.

    Parameters
    ----------
    geoms, points, radii
        Of the load points.
    keys : _Keys
        Of the footprints.
    active
        Geoms whose footprints are kept.
    touching : bool [c]
        Scratch, False.
    rows : int64 [n + m]
        Filled in: a row for each load point, then one for each footprint that is kept. It is -1
        before, which stays where no footprint serves.
    """
    count = len(geoms)
    for i in range(len(geoms)):
        touching[geoms[i]] = True
        for row in range(len(keys.geoms)):
            if keys.geoms[row] == geoms[i] and rows[i] < 0:
                distance2 = 0.0
                for k in range(3):
                    distance2 += (keys.points[row, k] - points[i, k]) ** 2
                tolerance = keys.tolerances[row]
                same_radius = abs(keys.radii[row] - radii[i]) <= tolerance
                if np.sqrt(distance2) <= tolerance and same_radius:
                    rows[i] = row
    for row in range(len(keys.geoms)):
        geom = keys.geoms[row]
        if active[geom] and not touching[geom]:
            rows[count] = row
            count += 1
    return count
