"""The corners of glued charts: how many charts meet in each, and the cells round irregular vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .topology import QUAD, TRIANGLE

# Row and column of the four corners of a chart with halo, in units of n + 1.
_CORNERS = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])


def close_corners(
    glued: NDArray[np.int64], n: int, halo: NDArray[np.int64], rim: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64], list[NDArray[np.int64]]]:
    """Fill in the halo's corners; return how many charts meet in each, its number, and the cells that are polygons."""
    valence, corners = np.zeros((len(glued), 4), np.int64), np.full((len(glued), 4), -1)
    polygons = []
    for chart in range(len(glued)):
        for corner in range(4):
            fan, closed = _fan(glued, chart, corner)
            texels = np.array([_corner_texel(c, k, n) for c, k in fan])
            place = (chart, *_CORNERS[corner] * (n + 1))
            count = len(fan)
            if corners[chart, corner] < 0:
                corners[tuple(np.transpose(fan))] = corners.max() + 1
            if closed:
                valence[chart, corner] = count
            if closed and count == QUAD:
                halo[place] = texels[2]
            elif not closed and count <= 2:
                # along a straight rim: beyond it lies what the chart on the other side of the corner has beside it
                halo[place] = texels[(fan.index((chart, corner)) + 1) % count]
                rim[place] = True
            elif count > (TRIANGLE if closed else 2) and (chart, corner) == min(fan):
                polygons.append(texels)
    return valence, corners, polygons


def _fan(glued: NDArray[np.int64], chart: int, corner: int) -> tuple[list[tuple[int, int]], bool]:
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


def _corner_texel(chart: int, corner: int, n: int) -> int:
    row, column = _CORNERS[corner] * (n - 1)
    return int((chart * n + row) * n + column)
