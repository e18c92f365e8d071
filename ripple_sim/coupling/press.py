"""How one body presses on one target over time: as it hits while it moves, ever more steadily once it rests."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.waves.footprint import footprint_at
from ripple_sim.solver.waves.load import Load, add_up

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
        self._texels = np.zeros(0, np.int64)
        self._rate = self._debt = np.zeros(0)
        self._middle: NDArray[np.float64] | None = None
        self._anchor = np.zeros(3)
        self._age = self._absent = 0.0

    def carry(self, carried: NDArray[np.float64]) -> None:
        """Press on a surface that has changed from now on: what is owed stays owed."""
        self._carried = carried
        self._sources: list[_Source] = []

    def press(self, pressed: Pressed, places: Places | None, dt: float) -> Load:
        """Load over a step in which the body touches.

        Parameters
        ----------
        pressed : Pressed
            Where and how hard, over this step.
        places : (float64 [k, 3], int64 [k]), optional
            The sources' nearest surface points [m] and texels, where they are known.
        dt : float
            Time step [s].
        """
        points, forces, radius = pressed.points, pressed.forces, pressed.radius
        self._sources = self._footprints(points, radius, places)
        self.latest = Load.together(
            [Load(source.texels, force * source.shares) for source, force in zip(self._sources, forces, strict=True)]
        )
        middle = forces @ points / forces.sum()
        if self._middle is None:
            self._middle = self._anchor = middle
        self._middle = self._middle + min(1.0, 2 * dt / ONSET) * (middle - self._middle)
        if np.linalg.norm(self._middle - self._anchor) > radius / 2:
            self._anchor, self._age = self._middle, 0.0
        self._absent = 0.0
        return self._follow(self.latest, dt)

    def release(self, dt: float) -> Load:
        """Load over a step in which the body does not touch."""
        self._absent += dt
        if self._absent > _LEFT and self._middle is not None:
            self._age, self._middle = 0.0, None
        return self._follow(Load.none(), dt)

    @property
    def over(self) -> bool:
        """Whether the body has left and nothing is owed."""
        return self._absent > _LEFT and not self._debt.any()

    def _follow(self, present: Load, dt: float) -> Load:
        left = ONSET - self._age
        self._age += dt
        if left > 0 and not self._debt.any():
            self._texels, self._rate, self._debt = present.texels, present.forces, np.zeros(len(present.texels))
            return present
        rate, debt, now = self._at_all_texels(present)
        if left > 0:
            # what is owed from before is paid in even parts until this time is over
            paid = debt * min(1.0, dt / left)
            self._rate, self._debt = now, debt - paid
            return Load(self._texels, now + paid / dt)
        pace = min(max(_FOLLOW / self._age, _SLOWEST), 0.5 / dt)
        self._rate = rate + dt * (pace**2 * debt + 2 * pace * (now - rate))
        self._debt = debt + dt * (now - self._rate)
        return Load(self._texels, self._rate)

    def _at_all_texels(self, present: Load) -> NDArray[np.float64]:
        """Rate, debt and present force, [3, k], on the texels of all three; those that hold nothing any more go."""
        kept = (self._debt != 0) | (self._rate != 0)
        before = self._texels[kept]
        values = np.zeros((3, len(before) + len(present.texels)))
        values[0, : len(before)], values[1, : len(before)] = self._rate[kept], self._debt[kept]
        values[2, len(before) :] = present.forces
        self._texels, values = add_up(np.concatenate([before, present.texels]), values, self._carried.size)
        return values

    def _footprints(self, points: NDArray[np.float64], radius: float, places: Places | None) -> list[_Source]:
        found = [self._used_before(point, radius) for point in points]
        new = [i for i, source in enumerate(found) if source is None]
        if new:
            closest, centers = self._atlas.nearest(points[new]) if places is None else (each[new] for each in places)
            for i, place, center in zip(new, closest, centers.tolist(), strict=True):
                where = footprint_at(self._atlas, place, center, radius)
                found[i] = _Source(
                    point=points[i],
                    radius=radius,
                    tolerance=_SAME_PLACE * float(np.sqrt(self._atlas.areas.flat[center])),
                    texels=where.texels,
                    shares=where.weights * self._carried[where.texels],
                )
        return [source for source in found if source is not None]

    def _used_before(self, point: NDArray[np.float64], radius: float) -> _Source | None:
        for source in self._sources:
            if (
                abs(source.radius - radius) <= source.tolerance
                and np.abs(source.point - point).max() <= source.tolerance
            ):
                return source
        return None


@dataclasses.dataclass(frozen=True, eq=False)
class _Source:
    """A footprint, and how far its point may move before it is made anew."""

    point: NDArray[np.float64]
    radius: float
    tolerance: float
    texels: NDArray[np.int64]
    shares: NDArray[np.float64]
