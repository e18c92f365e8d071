"""How the charts of a texel mesh are connected: which texel lies beyond each border texel of a chart.

A chart is a square of n x n texels. Its sides are numbered counter-clockwise, south (row 0), east, north, west; side s
runs from corner s to corner s + 1, so that corner 0 lies south-west. Two charts that share a side run along it in
opposite directions, as on any oriented surface.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

# A corner where so many charts meet is a triangle or a quad of the nine-point stencil.
TRIANGLE, QUAD = 3, 4


@dataclasses.dataclass(frozen=True, eq=False)
class TexelTopology:
    """The connectivity of C charts of n x n texels; make one with `glue`.

    Attributes
    ----------
    glued : int64 [C, 4, 2]
        The chart and the side that each side is glued to; -1 at a rim.
    halo : int64 [C, n + 2, n + 2]
        Halo table: flat index (chart n + row) n + column of the texel that each place of a chart with its halo shows. A
        place beyond a rim shows the texel beside it. -1 where none lies: at corners of other than four charts.
    rim : bool [C, n + 2, n + 2]
        Places beyond a rim.
    valence : int64 [C, 4]
        How many charts meet in each corner of a chart; 0 where a rim runs through it.
    corners : int64 [C, 4]
        Number of the point in which each corner of a chart lies: corners that meet have the same.
    polygons : tuple of int64 [k]
        The cells that do not fit the nine-point stencil: the texels round each corner of five charts and more, and of
        three and more at a rim, counter-clockwise.
    fixed_rim : bool
        Whether heights are 0 at rims; else rims are free, and heights beyond them those of the texels beside.
    """

    glued: NDArray[np.int64]
    halo: NDArray[np.int64]
    rim: NDArray[np.bool_]
    valence: NDArray[np.int64]
    corners: NDArray[np.int64]
    polygons: tuple[NDArray[np.int64], ...]
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
        own = np.zeros(self.halo.shape, dtype=bool)
        own[:, 1:-1, 1:-1] = True
        return own

    @functools.cached_property
    def ghosts(self) -> NDArray[np.bool_]:
        """Places of the halo that show a texel, [C, n + 2, n + 2]; those beyond a fixed rim show nothing."""
        ghosts = ~self.own & (self.halo >= 0)
        return ghosts & ~self.rim if self.fixed_rim else ghosts

    def with_halo(self, field: NDArray) -> NDArray:
        """Surround each chart of a field [C, n, n, ...] by its halo; 0 where no texel lies."""
        texels = field.reshape(self.texel_count, *field.shape[3:])[self.halo]
        texels[self.halo < 0] = 0
        return texels

    def with_boundary(self, field: NDArray) -> NDArray:
        """A height with its halo, as `with_halo`; beyond a fixed rim it is 0."""
        around = self.with_halo(field)
        if self.fixed_rim:
            around[self.rim] = 0
        return around

    @functools.cached_property
    def addresses(self) -> HaloAddresses:
        """Where texels and halo lie in a field with halo."""
        address = np.arange(self.halo.size).reshape(self.halo.shape)
        ghosts = self.ghosts
        texels = address[self.own]
        return HaloAddresses(texels, address[ghosts], texels[self.halo[ghosts]])


@dataclasses.dataclass(frozen=True, eq=False)
class HaloAddresses:
    """Flat addresses in a field with halo, [C, n + 2, n + 2].

    Attributes
    ----------
    texels : int64 [C n^2]
        Of every texel, by flat index.
    ghosts : int64 [k]
        Of the places of the halo that show a texel.
    sources : int64 [k]
        Of the texels that they show.
    """

    texels: NDArray[np.int64]
    ghosts: NDArray[np.int64]
    sources: NDArray[np.int64]
