"""The chart of the triangles that lie still.

Parts of a mesh that carry no waves share one chart, so that every point of the mesh has a place in
the atlas. Each triangle fills a rectangle of this chart: it is cut in two from its first corner to
the middle of the opposite side, and the halves are the halves of the rectangle.
"""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, Ints
from .pieces import Pieces

# Barycentric coordinates of the corners of a triangle's two halves.
_HALVES = np.array(
    [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.5, 0.5]],
        [[1.0, 0.0, 0.0], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]],
    ]
)

# Where these corners lie in the rectangle: column and row, 0 to 1.
_PLACES = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])


def still_pieces(triangles: Ints, chart: int) -> Pieces:
    """Pieces [2 k] of triangles [k] that fill a chart: about as many rows as columns."""
    row, column, rows, columns = _grid(len(triangles))
    size = np.stack([1 / columns[row], np.full(len(row), 1 / rows)], axis=1)
    corner = np.stack([column, row], axis=1) * size
    places = corner[:, None, None] + size[:, None, None] * _PLACES
    return Pieces(
        np.repeat(triangles, 2),
        np.tile(_HALVES, (len(triangles), 1, 1)),
        np.full(2 * len(triangles), chart),
        np.clip(places.reshape(-1, 3, 2), 0.0, 1.0),
    )


def still_texels(triangles: Ints, n: int) -> tuple[Ints, Floats]:
    """Triangles [n, n], of those given, and barycentrics [n, n, 3] of the texels of their chart."""
    _, _, rows, columns = _grid(len(triangles))
    first = np.cumsum(columns) - columns
    centre = (np.arange(n) + 0.5) / n
    row, up = _cell(centre, np.full(n, rows))
    column, right = _cell(np.broadcast_to(centre, (n, n)), columns[row][:, None])
    up = np.broadcast_to(up[:, None], (n, n))
    is_first_half = up <= right
    # in the half below the diagonal the weights are 1 - right, right - up and up
    along = np.maximum(right, up)
    beyond = np.minimum(right, up)
    outer = along - beyond
    weights = np.stack(
        [
            1 - along,
            np.where(is_first_half, outer, 0.0) + beyond / 2,
            np.where(is_first_half, 0.0, outer) + beyond / 2,
        ],
        axis=-1,
    )
    return triangles[first[row][:, None] + column], weights


def _grid(count: int) -> tuple[Ints, Ints, int, Ints]:
    """Row and column [count] of rectangles on a chart, its rows, and the columns of each row."""
    rows = max(round(np.sqrt(count)), 1)
    columns = np.full(rows, count // rows)
    columns[: count % rows] += 1
    row = np.repeat(np.arange(rows), columns)
    column = np.arange(count) - np.repeat(np.cumsum(columns) - columns, columns)
    return row, column, rows, columns


def _cell(place: Floats, cells: Ints) -> tuple[Ints, Floats]:
    """In which of so many equal cells from 0 to 1 a place lies, and where in it, 0 to 1."""
    scaled = place * cells
    cell = np.minimum(np.floor(scaled).astype(np.int64), cells - 1)
    return cell, scaled - cell
