"""How the charts of a texel mesh are connected: which texel lies beyond each border texel of a chart.

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

from ..errors import AtlasError
from ..kernel import Bools, Ints

# A corner where so many charts meet is a triangle or a quad of the nine-point stencil.
TRIANGLE = 3
QUAD = 4

# Row and column of the four corners of a chart with halo, in units of n + 1.
_CORNERS = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])


@dataclasses.dataclass(frozen=True, eq=False)
class TexelTopology:
    """The connectivity of C charts of n x n texels; make one with `glue`.

    Attributes
    ----------
    glued : int64 [C, 4, 2]
        The chart and the side that each side is glued to; -1 at a rim.
    halo : int64 [C, n + 2, n + 2]
        Halo table: flat index (chart n + row) n + column of the texel that each place of a chart
        with its halo shows. A place beyond a rim shows the texel beside it. -1 where none lies: at
        corners of other than four charts.
    rim : bool [C, n + 2, n + 2]
        Places beyond a rim.
    valence : int64 [C, 4]
        How many charts meet in each corner of a chart; 0 where a rim runs through it.
    corners : int64 [C, 4]
        Number of the point in which each corner of a chart lies: corners that meet have the same.
    polygons : tuple of int64 [k]
        The cells that do not fit the nine-point stencil: the texels round each corner of five
        charts and more, and of three and more at a rim, counter-clockwise.
    fixed_rim : bool
        Whether heights are 0 at rims; else rims are free, and heights beyond them those of the
        texels beside.
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
        return np.pad(np.ones(self.shape, dtype=bool), ((0, 0), (1, 1), (1, 1)))

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
    def addresses(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Flat addresses in a field with halo, [C, n + 2, n + 2].

        Those of every texel, by flat index [C n^2]; of the places of the halo that show a texel
        [k], which those beyond a fixed rim do not; and of the texels that they show [k].
        """
        address = np.arange(self.halo.size).reshape(self.halo.shape)
        ghosts = ~self.own & (self.halo >= 0) & ~(self.rim & self.fixed_rim)
        texels = address[self.own]
        return texels, address[ghosts], texels[self.halo[ghosts]]


def close_corners(glued: Ints, n: int, halo: Ints, rim: Bools) -> tuple[Ints, Ints, list[Ints]]:
    """Fill in the halo's corners; return how many charts meet in each, its number, and the cells that are polygons."""
    valence = np.zeros((len(glued), 4), np.int64)
    corners = np.full((len(glued), 4), -1)
    polygons = []
    for chart, corner in np.ndindex(valence.shape):
        fan, closed = _fan(glued, chart, corner)
        texels = np.array([c * n * n + _CORNERS[k] @ (n, 1) * (n - 1) for c, k in fan])
        place = (chart, *_CORNERS[corner] * (n + 1))
        count = len(fan)
        if corners[chart, corner] < 0:
            corners[tuple(np.transpose(fan))] = corners.max() + 1
        if closed:
            valence[chart, corner] = count
        if closed and count == QUAD:
            halo[place] = texels[2]
        elif not closed and count <= 2:
            # along a straight rim: beyond it lies what the chart on the other side of the corner
            # has beside it
            halo[place] = texels[(fan.index((chart, corner)) + 1) % count]
            rim[place] = True
        elif count > (TRIANGLE if closed else 2) and (chart, corner) == min(fan):
            polygons.append(texels)
    return valence, corners, polygons


def _fan(glued: Ints, chart: int, corner: int) -> tuple[list[tuple[int, int]], bool]:
    """The corners (chart, corner) that meet in one, counter-clockwise, and whether they surround it.

    From the one itself where they do, else from rim to rim.
    """
    fan = [(chart, corner)]
    while True:
        # over the side that ends in the corner; the one that it is glued to begins there
        other, side = (int(x) for x in glued[fan[-1][0], (fan[-1][1] + 3) % 4])
        if other < 0:
            break
        if (other, side) == fan[0]:
            return fan, True
        fan.append((other, side))
    while True:
        other, side = (int(x) for x in glued[fan[0][0], fan[0][1]])
        if other < 0:
            return fan, False
        fan.insert(0, (other, (side + 1) % 4))


def glue(glued: NDArray[np.int64], n: int) -> TexelTopology:
    """Connect charts of n x n texels along their sides.

    Parameters
    ----------
    glued : int64 [C, 4, 2]
        Chart and side beyond each side; -1 where there is none. Mutual: the side beyond the side
        beyond is the side itself.
    n : int
        Texels along a side.

    Raises
    ------
    AtlasError
        If the table is of another shape, or not mutual.
    """
    glued = np.asarray(glued, dtype=np.int64)
    if glued.ndim != 3 or glued.shape[1:] != (4, 2) or not len(glued):
        raise AtlasError(
            f"the table of glued sides has shape {glued.shape}; valid is [C, 4, 2]: chart and side "
            f"beyond each"
        )
    for chart, side in np.argwhere(glued[..., 0] >= 0).tolist():
        other, back = glued[chart, side].tolist()
        if not (
            other < len(glued) and 0 <= back < 4 and glued[other, back].tolist() == [chart, side]
        ):
            raise AtlasError(
                f"side {side} of chart {chart} is glued to side {back} of chart {other}, which is "
                f"not glued back to it"
            )
    charts = len(glued)
    size = n * n
    halo = np.full((charts, n + 2, n + 2), -1)
    rim = np.zeros(halo.shape, dtype=bool)
    first = size * np.arange(charts)[:, None]
    halo[:, 1:-1, 1:-1] = np.arange(charts * size).reshape(charts, n, n)
    border = _along_sides(np.arange(n), n)
    beyond = _along_sides(np.arange(1, n + 1), n + 2)
    for side in range(4):
        chart, other = glued[:, side].T
        is_rim = chart < 0
        # counter-clockwise on both charts: the texels of the other side come in reverse
        across = size * chart[:, None] + border[other][:, ::-1]
        halo.reshape(charts, -1)[:, beyond[side]] = np.where(
            is_rim[:, None], first + border[side], across
        )
        rim.reshape(charts, -1)[:, beyond[side]] = is_rim[:, None]
    valence, corners, polygons = close_corners(glued, n, halo, rim)
    for array in (halo, rim, valence, corners):
        array.setflags(write=False)
    return TexelTopology(glued, halo, rim, valence, corners, tuple(polygons))


def _along_sides(along: Ints, width: int) -> Ints:
    """Flat places along each side of a square of so many rows and columns, [4, n]."""
    last = width - 1
    return np.stack(
        [along, along * width + last, last * width + last - along, (last - along) * width]
    )
