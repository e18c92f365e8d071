"""How the charts of a texel mesh are connected: which texel lies beyond each border texel.

A chart is a square of n x n texels. Its sides are numbered counter-clockwise, south (row 0), east,
north, west; side s runs from corner s to corner s + 1, so that corner 0 lies south-west. Two charts
that share a side run along it in opposite directions, as on any oriented surface. Each chart has a
halo, copies of the texels beyond its border, so that fields can be read, and interpolated, across
sides; corners of other than four charts are cells of their own.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

# Charts that meet in a corner whose cell is a triangle.
TRIANGLE = 3


@dataclasses.dataclass(frozen=True, eq=False)
class TexelTopology:
    """The connectivity of C charts of n x n texels; make one with `glue`.

    Attributes
    ----------
    glued : int64 [C, 4, 2]
        The chart and the side that each side is glued to; -1 at a rim.
    halo : int64 [C, n + 2, n + 2]
        Halo table: flat index (chart n + row) n + column of the texel that each place of a chart
        with its halo shows. A place beyond a rim shows the texel beside it. -1 where no texel lies:
        in corners of other than four charts.
    rim : bool [C, n + 2, n + 2]
        Places beyond a rim.
    valence : int64 [C, 4]
        Number of charts that meet in each corner of a chart; 0 where a rim runs through it.
    corners : int64 [C, 4]
        Number of the point in which each corner of a chart lies: corners that meet have the same
        number.
    polygons : tuple of int64 [k]
        The cells that do not fit the nine-point stencil: the texels round each corner of five
        charts and more, and of three and more at a rim, counter-clockwise.
    still : bool [C]
        Charts that lie still: there are no cells between their texels.
    fixed_rim : bool
        Whether heights are 0 at rims. Otherwise rims are free, and a height beyond a rim is that of
        the texel beside it.
    """

    glued: NDArray[np.int64]
    halo: NDArray[np.int64]
    rim: NDArray[np.bool_]
    valence: NDArray[np.int64]
    corners: NDArray[np.int64]
    polygons: tuple[NDArray[np.int64], ...]
    still: NDArray[np.bool_]
    fixed_rim: bool = False

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape (C, n, n) of a field."""
        charts, width, _ = self.halo.shape
        return charts, width - 2, width - 2

    @property
    def texel_count(self) -> int:
        """Number of texels, C n^2."""
        charts, n, _ = self.shape
        return charts * n * n

    @functools.cached_property
    def own(self) -> NDArray[np.bool_]:
        """Places that are a chart's own texels, not its halo, [C, n + 2, n + 2]."""
        return np.pad(np.ones(self.shape, dtype=bool), ((0, 0), (1, 1), (1, 1)))

    def with_halo(self, field: NDArray) -> NDArray:
        """Surround each chart of a field [C, n, n, ...] by its halo; 0 where no texel lies."""
        texels = field.reshape(self.texel_count, *field.shape[3:])[self.halo]
        texels[self.halo < 0] = 0
        return texels

    def with_boundary(self, field: NDArray) -> NDArray:
        """A height with its halo, like `with_halo`, but 0 beyond a fixed rim."""
        around = self.with_halo(field)
        if self.fixed_rim:
            around[self.rim] = 0
        return around

    @functools.cached_property
    def addresses(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Flat addresses in a field with halo, [C, n + 2, n + 2].

        First the addresses of all texels, by flat index [C n^2]; then those of the places of the
        halo that show a texel, [k], and of the texels that they show, [k]. Places beyond a fixed
        rim show none.
        """
        address = np.arange(self.halo.size).reshape(self.halo.shape)
        ghosts = ~self.own & (self.halo >= 0) & ~(self.rim & self.fixed_rim)
        texels = address[self.own]
        return texels, address[ghosts], texels[self.halo[ghosts]]
