"""How one body presses on one target over time: as it hits while it moves, ever more steadily once it rests."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import WaveSolver
from ripple_sim.solver.waves.footprint import footprint

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
    waves : WaveSolver
        Of the target.

    Attributes
    ----------
    spread : (int64 [n], float64 [n])
        Texels of the latest contact, and each one's share of its force.
    """

    def __init__(self, waves: WaveSolver) -> None:
        self._atlas = waves.atlas
        self._carried = (waves.atlas.areas * waves.operator.carries).reshape(-1)
        self.spread = np.zeros(0, np.int64), np.zeros(0)
        self._sources: list[_Source] = []
        self._texels = np.zeros(0, np.int64)
        self._rate = self._debt = np.zeros(0)
        self._middle: NDArray[np.float64] | None = None
        self._anchor = np.zeros(3)
        self._age = self._absent = 0.0

    def press(
        self, points: NDArray[np.float64], forces: NDArray[np.float64], radius: float, dt: float
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Forces on the texels over a step in which the body touches.

        Parameters
        ----------
        points : [k, 3]
            Where it presses, in the target's frame [m].
        forces : [k]
            How hard [N].
        radius : float
            Footprint radius of every source [m].
        dt : float
            Time step [s].

        Returns
        -------
        texels : int64 [n]
            Flat indices, ascending.
        forces : float64 [n]
            [N], positive inwards.
        """
        self._sources = [self._footprint(point, radius) for point in points]
        texels, where = np.unique(np.concatenate([source.texels for source in self._sources]), return_inverse=True)
        loads = np.concatenate([force * source.shares for force, source in zip(forces, self._sources, strict=True)])
        pressed = np.bincount(where, loads, len(texels)).astype(np.float64)
        self.spread = texels, pressed / forces.sum()
        middle = forces @ points / forces.sum()
        if self._middle is None:
            self._middle = self._anchor = middle
        self._middle = self._middle + min(1.0, 2 * dt / ONSET) * (middle - self._middle)
        if np.linalg.norm(self._middle - self._anchor) > radius / 2:
            self._anchor, self._age = self._middle, 0.0
        self._absent = 0.0
        return self._follow(texels, pressed, dt)

    def release(self, dt: float) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Forces on the texels over a step in which the body does not touch."""
        self._absent += dt
        if self._absent > _LEFT and self._middle is not None:
            self._age, self._middle = 0.0, None
        return self._follow(self._texels[:0], self._debt[:0], dt)

    @property
    def over(self) -> bool:
        """Whether the body has left and nothing is owed."""
        return self._absent > _LEFT and not self._debt.any()

    def _follow(
        self, texels: NDArray[np.int64], forces: NDArray[np.float64], dt: float
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        self._cover(texels)
        present = np.zeros(len(self._texels))
        present[np.searchsorted(self._texels, texels)] = forces
        left = ONSET - self._age
        self._age += dt
        if left > 0:
            # what is owed from before is paid in even parts until this time is over
            paid = self._debt * min(1.0, dt / left)
            self._debt, self._rate = self._debt - paid, present
            return self._texels, present + paid / dt
        pace = min(max(_FOLLOW / self._age, _SLOWEST), 0.5 / dt)
        self._rate = self._rate + dt * (pace**2 * self._debt + 2 * pace * (present - self._rate))
        self._debt = self._debt + dt * (present - self._rate)
        return self._texels, self._rate

    def _cover(self, texels: NDArray[np.int64]) -> None:
        """Keep the texels that something is owed to or that still are pressed upon, and add others."""
        if len(texels) == len(self._texels) and np.array_equal(texels, self._texels):
            return
        kept = (self._debt != 0) | (self._rate != 0)
        wanted = np.union1d(self._texels[kept], texels)
        rate, debt = np.zeros(len(wanted)), np.zeros(len(wanted))
        place = np.searchsorted(wanted, self._texels[kept])
        rate[place], debt[place] = self._rate[kept], self._debt[kept]
        self._texels, self._rate, self._debt = wanted, rate, debt

    def _footprint(self, point: NDArray[np.float64], radius: float) -> _Source:
        for source in self._sources:
            moved = np.abs(source.point - point).max()
            if moved <= source.tolerance and abs(source.radius - radius) <= source.tolerance:
                return source
        where = footprint(self._atlas, point, radius)
        return _Source(
            point=point,
            radius=radius,
            tolerance=_SAME_PLACE * float(np.sqrt(self._atlas.areas.flat[where.center])),
            texels=where.texels,
            shares=where.weights * self._carried[where.texels],
        )


@dataclasses.dataclass(frozen=True, eq=False)
class _Source:
    """A footprint, and how far its point may move before it is made anew."""

    point: NDArray[np.float64]
    radius: float
    tolerance: float
    texels: NDArray[np.int64]
    shares: NDArray[np.float64]
