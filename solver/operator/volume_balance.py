"""What keeps the volume when sources act: a pressure on the whole surface, as of an incompressible interior."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .wave_operator import WaveOperator


class VolumeBalance:
    """Takes the mean out of sources, one for each part of the surface that floats freely; see `floating_parts`.

    A pressure moves each texel by one over its density. Taking that much of it out of a momentum leaves the sum of area
    times velocity unchanged, and is the orthogonal projection with masses as weights: it adds no energy.

    Parameters
    ----------
    operator : WaveOperator
    """

    def __init__(self, operator: WaveOperator) -> None:
        self._operator = operator
        self._parts = None if operator.parts is None else operator.parts.reshape(-1)
        self._lightness = operator.lightness.reshape(-1)
        self._least = self._sum(operator.mass * operator.lightness * operator.response)

    def counterpart(self, texels: NDArray[np.int64], momenta: NDArray[np.float64]) -> float | NDArray[np.float64]:
        """Amplitude of the operator's `response` that balances momenta [k] on some texels [k].

        [m/s], or for forces [m/s^2]; a number, or one for each part.
        """
        weighed = self._lightness[texels] * momenta
        if self._parts is None:
            return -float(weighed.sum()) / float(self._least) if self._least else 0.0
        # of no texels, bincount makes integers
        sums = np.bincount(self._parts[texels], weighed, len(self._least)).astype(np.float64)
        return np.divide(-sums, self._least, out=np.zeros_like(sums), where=self._least > 0)

    def balanced_velocity(self, field: NDArray[np.float64]) -> NDArray[np.float64]:
        """A velocity field [C, n, n] without its volume rate."""
        operator = self._operator
        return field - operator.response * self._ratio(operator.mass * operator.lightness * field, self._least)

    def balanced_height(self, field: NDArray[np.float64], areas: NDArray[np.float64]) -> NDArray[np.float64]:
        """A height field [C, n, n] without its mean."""
        return field - self._operator.movable * self._ratio(areas * field, self._sum(areas))

    def _sum(self, field: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sum over the movable texels of each part, [p]; a number where there is one."""
        movable = self._operator.movable
        if self._parts is None:
            return field[movable].sum()
        return np.bincount(self._parts, (field * movable).reshape(-1)).astype(np.float64)

    def _ratio(self, field: NDArray[np.float64], total: NDArray[np.float64]) -> NDArray[np.float64] | float:
        """Sum of a field over each part, over a total of that part: at every texel, [C, n, n]."""
        if self._parts is None:
            return float(field.sum()) / float(total) if total else 0.0
        sums = np.bincount(self._parts, field.reshape(-1))
        ratio = np.divide(sums, total, out=np.zeros_like(sums), where=total > 0)
        return ratio[self._parts].reshape(field.shape)
