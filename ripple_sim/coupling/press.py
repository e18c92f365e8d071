"""How one body presses on one target over time: as it hits while it moves, ever more steadily once it rests."""

from __future__ import annotations

import dataclasses
import math

import numba
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.waves.footprint import footprint_at
from ripple_sim.solver.waves.load import Load, add_up_by, nowhere

from .patch import Pressed

Places = tuple[NDArray[np.float64], NDArray[np.int64]]

# A hit is over within this time [s]; until then the surface feels every force as it is.
ONSET = 0.1
# A body that has not touched for this long has left [s]. Contacts of a body at rest flicker from step to step.
_LEFT = 0.02
# A body that has stayed in its place for a time t is followed with a frequency of _FOLLOW / t, [1/s] at the least.
_FOLLOW, _SLOWEST = 2.0, 1.0
# A footprint is used again while its point moves by less than this share of a texel.
_SAME_PLACE = 0.3


class Press:
    """The pressure of one body on one target.

    MuJoCo's contact forces flicker from step to step also where a body lies still, and would keep the surface
    boiling. So the longer a body stays in its place, the slower the force on the surface follows the contact force f:
    g' = w^2 d + 2 w (f - g), d' = f - g, with w falling as one over the time. The debt d is what the surface has not
    got yet [N s]: nothing is lost, a constant force comes through as it is, and noise is averaged. All this is
    done texel by texel, so that places are smoothed as well as amounts.

    Parameters
    ----------
    atlas : Atlas
        Of the target.
    carried : float64 [6 N N]
        Area of each texel that takes up pressure [m^2], 0 where nothing moves.

    Attributes
    ----------
    latest : Load
        How the body pressed in its latest contact, before that is smoothed.
    """

    def __init__(self, atlas: Atlas, carried: NDArray[np.float64]) -> None:
        self._atlas = atlas
        self.carry(carried)
        self.latest = Load.none()
        # texels, what the surface feels at each of them [N] and is owed there [N s]
        self._texels = np.zeros(0, np.int64)
        self._felt = self._owed = np.zeros(0)
        self._owing = False
        self._middle: list[float] | None = None
        self._anchor = [0.0, 0.0, 0.0]
        self._age = self._absent = 0.0

    def carry(self, carried: NDArray[np.float64]) -> None:
        """Press on a surface that has changed from now on: what is owed stays owed."""
        self._carried = carried
        self._sources: list[_Source] = []

    def press(self, pressed: Pressed, places: Places, middle: NDArray[np.float64], dt: float) -> Load:
        """Load over a step in which the body touches.

        Parameters
        ----------
        pressed : Pressed
            Where and how hard, over this step.
        places : (float64 [m, 3], int64 [m])
            Surface points [m] and texels nearest to the patch's probes.
        middle : float64 [3]
            Force-weighted contact point [m].
        dt : float
            Time step [s].
        """
        self._sources = self._footprints(pressed, places)
        forces = pressed.forces.tolist()
        self.latest = Load.together(
            [Load(source.texels, force * source.shares) for source, force in zip(self._sources, forces, strict=True)]
        )
        self._absent = 0.0
        self._move(middle.tolist(), pressed.radius / 2, min(1.0, 2 * dt / ONSET))
        return self._smooth(self.latest, dt)

    def release(self, dt: float) -> Load:
        """Load over a step in which the body does not touch."""
        self._absent += dt
        if self._absent > _LEFT and self._middle is not None:
            self._age, self._middle = 0.0, None
        return self._smooth(Load.none(), dt)

    @property
    def over(self) -> bool:
        """Whether the body has left and nothing is owed."""
        return self._absent > _LEFT and not self._owing

    def _move(self, middle: list[float], most: float, pace: float) -> None:
        """Follow the body's smoothed place; all begins anew where that is farther than `most` [m] from its start."""
        if self._middle is None:
            self._middle = self._anchor = middle
        self._middle = [old + pace * (new - old) for old, new in zip(self._middle, middle, strict=True)]
        if math.dist(self._middle, self._anchor) > most:
            self._anchor, self._age = self._middle, 0.0

    def _smooth(self, present: Load, dt: float) -> Load:
        left = ONSET - self._age
        self._age += dt
        if left > 0 and not self._owing:
            self._texels, self._felt, self._owed = present.texels, present.forces, np.zeros(len(present.texels))
            return present
        # what is owed from before is paid in even parts until the onset is over
        share = min(1.0, dt / left) if left > 0 else 0.0
        pace = 0.0 if left > 0 else min(max(_FOLLOW / self._age, _SLOWEST), 0.5 / dt)
        self._texels, given, self._felt, self._owed, self._owing = _follow(
            self._texels,
            self._felt,
            self._owed,
            present.texels,
            present.forces,
            share,
            pace,
            dt,
            nowhere(self._carried.size),
        )
        return Load(self._texels, given)

    def _footprints(self, pressed: Pressed, places: Places) -> list[_Source]:
        points, radius = pressed.points.tolist(), pressed.radius
        found = [self._used_before(point, radius) for point in points]
        new = [i for i, source in enumerate(found) if source is None]
        if new:
            known = pressed.probes[new]
            closest, centers = self._atlas.nearest(pressed.points[new]) if known[0] < 0 else (x[known] for x in places)
            for i, place, center in zip(new, closest, centers.tolist(), strict=True):
                where = footprint_at(self._atlas, place, center, radius)
                found[i] = _Source(
                    point=points[i],
                    radius=radius,
                    tolerance=_SAME_PLACE * math.sqrt(self._atlas.areas.item(center)),
                    texels=where.texels,
                    shares=where.weights * self._carried[where.texels],
                )
        return [source for source in found if source is not None]

    def _used_before(self, point: list[float], radius: float) -> _Source | None:
        for source in self._sources:
            if max(abs(source.radius - radius), math.dist(source.point, point)) <= source.tolerance:
                return source
        return None


@dataclasses.dataclass(frozen=True, eq=False)
class _Source:
    """A footprint, and how far its point may move before it is made anew."""

    point: list[float]
    radius: float
    tolerance: float
    texels: NDArray[np.int64]
    shares: NDArray[np.float64]


@numba.njit(cache=True)
def _follow(texels, felt, owed, present_texels, present_forces, share, pace, dt, place):
    """Texels, given force, felt force and debt after a step, and whether there is a debt.

    A share of the debt is paid while pace is 0; then the felt force follows the present one.
    """
    kept = (felt != 0) | (owed != 0)
    before = texels[kept]
    count = len(before)
    values = np.zeros((3, count + len(present_texels)))
    values[0, :count], values[1, :count], values[2, count:] = felt[kept], owed[kept], present_forces
    texels, values = add_up_by(place, np.concatenate((before, present_texels)), values)
    felt, owed, present = values[0], values[1], values[2]
    if pace == 0:
        paid = share * owed
        given, felt, owed = present + paid / dt, present, owed - paid
    else:
        felt = felt + dt * (pace**2 * owed + 2 * pace * (present - felt))
        given, owed = felt, owed + dt * (present - felt)
    return texels, given, felt, owed, owed.any()
