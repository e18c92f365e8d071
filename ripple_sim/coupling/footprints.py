"""Footprints under the geoms on a target, reused while their points stay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel
from ripple_sim.solver.texels.chart_map import nearest_places
from ripple_sim.solver.texels.distance import distance_scratch
from ripple_sim.solver.waves.footprint import weigh

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
