"""A page: all charts with their halos in one rectangle, so that one texture holds them all."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray


@dataclasses.dataclass(frozen=True)
class ChartPage:
    """Rows of charts with a halo of one texel.

    Attributes
    ----------
    charts : int
        How many, C.
    resolution : int
        Texels along a chart's side, n.
    """

    charts: int
    resolution: int

    @property
    def block(self) -> int:
        """Texels along a side of a chart with its halo."""
        return self.resolution + 2

    @property
    def columns(self) -> int:
        """Charts side by side."""
        return math.ceil(math.sqrt(self.charts))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the page [texels]."""
        rows = -(-self.charts // self.columns)
        return self.columns * self.block, rows * self.block

    def corner(self, chart: int) -> tuple[int, int]:
        """Column and row of the page's texel in which a chart's halo begins."""
        row, column = divmod(chart, self.columns)
        return column * self.block, row * self.block

    def locate(
        self, places: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Chart, row and column of places [k, 2] on the page, each [k].

        Row and column 0.0 are at the centre of the first texel.
        """
        block = np.floor(places / self.block).astype(np.int64)
        column, row = (places - block * self.block - 1.5).T
        return block[:, 1] * self.columns + block[:, 0], row, column

    def places(self, chart: NDArray[np.int64], uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Places on the page [k, 2], in texels from its corner.

        `uv` [k, 2] are places in the charts [k], 0 to 1.
        """
        row, column = np.divmod(chart, self.columns)
        return np.stack([column, row], axis=1) * self.block + 1.0 + self.resolution * uv
