"""Connecting charts along their sides: the halo table, rims and corners of a texel mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..errors import AtlasError
from .corners import close_corners
from .topology import TexelTopology


def glue(glued: NDArray[np.int64], n: int) -> TexelTopology:
    """Connect charts of n x n texels along their sides.

    Parameters
    ----------
    glued : int64 [C, 4, 2]
        Chart and side beyond each side; -1 where there is none. Mutual: the side beyond the side beyond is the side
        itself.
    n : int
        Texels along a side.

    Raises
    ------
    AtlasError
        If the table is of another shape, or not mutual.
    """
    glued = _checked(glued)
    charts, size = len(glued), n * n
    halo = np.full((charts, n + 2, n + 2), -1)
    rim = np.zeros(halo.shape, dtype=bool)
    first = size * np.arange(charts)[:, None]
    halo[:, 1:-1, 1:-1] = np.arange(charts * size).reshape(charts, n, n)
    border, beyond = _border_texels(n), _places_beyond(n)
    for side in range(4):
        chart, other = glued[:, side].T
        is_rim = chart < 0
        # counter-clockwise on both charts: the texels of the other side come in reverse
        across = size * chart[:, None] + border[other][:, ::-1]
        halo.reshape(charts, -1)[:, beyond[side]] = np.where(is_rim[:, None], first + border[side], across)
        rim.reshape(charts, -1)[:, beyond[side]] = is_rim[:, None]
    valence, corners, polygons = close_corners(glued, n, halo, rim)
    for array in (halo, rim, valence, corners):
        array.setflags(write=False)
    return TexelTopology(glued, halo, rim, valence, corners, tuple(polygons))


def _checked(glued: NDArray[np.int64]) -> NDArray[np.int64]:
    table = np.asarray(glued, dtype=np.int64)
    if table.ndim != 3 or table.shape[1:] != (4, 2) or not len(table):
        raise AtlasError(
            f"the table of glued sides has shape {table.shape}; valid is [C, 4, 2]: chart and side beyond each"
        )
    joined = np.argwhere(table[..., 0] >= 0)
    for chart, side in joined.tolist():
        other, back = table[chart, side].tolist()
        if not (other < len(table) and 0 <= back < 4 and table[other, back].tolist() == [chart, side]):
            raise AtlasError(
                f"side {side} of chart {chart} is glued to side {back} of chart {other}, which is not glued back to it"
            )
    return table


def _border_texels(n: int) -> NDArray[np.int64]:
    """Index row n + column of the texels along each side of a chart, [4, n]."""
    along, last = np.arange(n), n - 1
    return np.stack([along, along * n + last, last * n + last - along, (last - along) * n])


def _places_beyond(n: int) -> NDArray[np.int64]:
    """Address of the places beyond each side in a chart with halo, [4, n]."""
    along, width, last = np.arange(1, n + 1), n + 2, n + 1
    return np.stack([along, along * width + last, last * width + last - along, (last - along) * width])
