"""A curve over the whole length of a video in bounded memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MOST_POINTS = 1024  # more than the energy plot has columns of pixels, save on very large frames


class History:
    """One value per frame, thinned to at most `MOST_POINTS`: of several frames the largest is kept.

    Parameters
    ----------
    frames : int
        How many will come.
    """

    def __init__(self, frames: int) -> None:
        self._stride = -(-frames // MOST_POINTS)
        self._values = np.zeros(-(-frames // self._stride))
        self._frames = 0

    def add(self, value: float) -> None:
        """Take in the value of the next frame."""
        point, late = divmod(self._frames, self._stride)
        self._values[point] = max(self._values[point], value) if late else value
        self._frames += 1

    def curve(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Frame numbers and values of the points so far: copies."""
        points = -(-self._frames // self._stride)
        return np.arange(points, dtype=np.float64) * self._stride, self._values[:points].copy()
