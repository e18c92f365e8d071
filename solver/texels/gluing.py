"""Charts are glued along their sides: the halo table, and the corners where charts meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import AtlasError
from ..kernel import Bools, Ints
from .topology import TRIANGLE, TexelTopology

# Charts that meet in a corner whose cell is a quad of the nine-point stencil.
QUAD = 4

# Row and column of the four corners of a chart with halo, in units of n + 1.
_CORNERS = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])


def close_corners(glued: Ints, n: int, halo: Ints, rim: Bools) -> tuple[Ints, Ints, list[Ints]]:
    """Fill in the corners of the halo; return valence, corners and polygons of the topology."""
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
            # on a straight rim: the place beyond it shows the texel that the chart on the other
            # side of the corner has beside it
            halo[place] = texels[(fan.index((chart, corner)) + 1) % count]
            rim[place] = True
        elif count > (TRIANGLE if closed else 2) and (chart, corner) == min(fan):
            polygons.append(texels)
    return valence, corners, polygons


def _fan(glued: Ints, chart: int, corner: int) -> tuple[list[tuple[int, int]], bool]:
    """The corners (chart, corner) that meet in one point, and whether they surround it.

    Counter-clockwise: from the given corner where they surround the point, else from rim to rim.
    """
    fan = [(chart, corner)]
    while True:
        # over the side that ends in the corner; the side to which it is glued begins there
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


def glue(glued: NDArray[np.int64], n: int, still: NDArray[np.bool_] | None = None) -> TexelTopology:
    """Connect charts of n x n texels along their sides.

    Parameters
    ----------
    glued : int64 [C, 4, 2]
        Chart and side to which each side is glued; -1 where there is none. Mutual: the other side
        is glued back to the side itself.
    n : int
        Texels along a side.
    still : bool [C], optional
        Charts that lie still, none by default.

    Raises
    ------
    AtlasError
        If the table is of another shape, or not mutual.
    """
    glued = np.asarray(glued, dtype=np.int64)
    if glued.ndim != 3 or glued.shape[1:] != (4, 2) or not len(glued):
        raise AtlasError(
            "the table of glued sides must have shape [C, 4, 2], the chart and the side beyond "
            f"each side, got {glued.shape}"
        )
    for chart, side in np.argwhere(glued[..., 0] >= 0).tolist():
        other, back = glued[chart, side].tolist()
        exists = other < len(glued) and 0 <= back < 4
        if not exists or glued[other, back].tolist() != [chart, side]:
            raise AtlasError(
                f"side {side} of chart {chart} is glued to side {back} of chart {other}, which is "
                "not glued back to it"
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
    still = np.zeros(charts, bool) if still is None else np.asarray(still, bool)
    for array in (halo, rim, valence, corners):
        array.setflags(write=False)
    return TexelTopology(glued, halo, rim, valence, corners, tuple(polygons), still)


def _along_sides(along: Ints, width: int) -> Ints:
    """Flat places along each side of a square with n rows and columns, [4, n]."""
    last = width - 1
    return np.stack(
        [along, along * width + last, last * width + last - along, (last - along) * width]
    )
