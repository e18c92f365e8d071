"""The tiles of the frame in which something may show."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.resources import Resources

_TILE = 32  # [pixels]


class Tiles:
    """The square tiles of the frame that any of some boxes touches, as instances for a shader.

    Parameters
    ----------
    resources : Resources
    size : (width, height)
        Of the frame [pixels].
    """

    def __init__(self, resources: Resources, size: tuple[int, int]) -> None:
        self._mask = np.zeros((-(-size[1] // _TILE), -(-size[0] // _TILE)), dtype=bool)
        self._scale = 2.0 * _TILE / np.array(size)
        self.buffer: moderngl.Buffer = resources.buffer(reserve=8 * self._mask.size, dynamic=True)
        self.count = 0

    @property
    def extent(self) -> tuple[float, float]:
        """Width and height of a tile, where the frame extends from -1 to 1."""
        return float(self._scale[0]), float(self._scale[1])

    def cover(self, boxes: NDArray[np.int64]) -> None:
        """Select the tiles that any of some boxes [k, 4] touches; see `boxes_of`."""
        self._mask[...] = False
        for left, lower, right, upper in boxes[(boxes[:, :2] < boxes[:, 2:]).all(axis=1)]:
            self._mask[lower // _TILE : -(-upper // _TILE), left // _TILE : -(-right // _TILE)] = True
        tiles = np.argwhere(self._mask)[:, ::-1]
        self.count = len(tiles)
        if self.count:
            self.buffer.write((tiles * self._scale - 1.0).astype("f4").tobytes())
