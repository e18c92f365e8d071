"""Arrays of a model that its user may write to at any time, looked at before each frame or step.

A look at a large array costs no more than one at a small one: samples of all of it are compared, and one stretch after
another whole.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_WHOLE = 1 << 20  # bytes that are compared whole at each look: some 0.05 ms
_STRETCH = 1 << 18  # bytes of a larger array that are compared at each look, one stretch after another
_SAMPLES = 4096  # of a larger array that are compared at each look


class WatchedArray:
    """Tells whether an array was written to.

    Parameters
    ----------
    array : array
        Contiguous, in whose memory others write.
    """

    def __init__(self, array: NDArray) -> None:
        self._bytes = array.reshape(-1).view(np.uint8)
        self._step = max(len(self._bytes) // _SAMPLES, 1)
        self._next = 0
        self.take()

    def take(self) -> None:
        """Remember what is there now."""
        self._taken = self._bytes.copy()

    def changed(self) -> bool:
        """Whether something else is there than was taken: of a large array whatever this look comes across."""
        now, taken = self._bytes, self._taken
        if len(now) <= _WHOLE:
            return not np.array_equal(now, taken)
        stretch = slice(self._next, self._next + _STRETCH)
        self._next = stretch.stop if stretch.stop < len(now) else 0
        return not (
            np.array_equal(now[stretch], taken[stretch]) and np.array_equal(now[:: self._step], taken[:: self._step])
        )

    def differs(self, start: int, count: int) -> bool:
        """Whether something else is there than was taken from a byte on, over so many bytes."""
        part = slice(start, start + count)
        return not np.array_equal(self._bytes[part], self._taken[part])
