"""A chart map that follows texels which have left the centres of their squares.

The texel centres of a chart and its border are the nodes of a lattice of triangles. Moved nodes move the triangles, and
each is laid out again as it was: a texel is then found at its own row and column, wherever on the surface it lies.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kernel import Bools, Floats, Ints, kernel
from .pieces import LEAST, MOST_CORNERS, Pieces, area


def warped(pieces: Pieces, offsets: NDArray[np.float64]) -> Pieces:
    """Pieces of a map whose texels have moved by `offsets` [C, n, n, 2] (column, row, in texels)."""
    moved = np.pad(offsets, ((0, 0), (1, 1), (1, 1), (0, 0)))
    # squares of the lattice of which a corner moves, [C, n + 1, n + 1]
    away = (moved != 0).any(axis=-1)
    bent = away[:, :-1, :-1] | away[:, 1:, :-1] | away[:, :-1, 1:] | away[:, 1:, 1:]
    size = _cut(pieces, moved, bent, np.empty(0, np.int64), np.empty((0, 3, 3)), np.empty((0, 3, 2)))
    origin, inside, places = np.empty(size, np.int64), np.empty((size, 3, 3)), np.empty((size, 3, 2))
    _cut(pieces, moved, bent, origin, inside, places)
    barycentrics = inside @ pieces.barycentrics[origin]
    return Pieces(pieces.triangle[origin], barycentrics, pieces.chart[origin], np.clip(places, 0.0, 1.0))


@kernel
def _cut(pieces: Pieces, moved: Floats, bent: Bools, origin: Ints, inside: Floats, places: Floats) -> int:
    """Fill in the parts of pieces as far as there is room, and return how many there are."""
    n, count, room = moved.shape[1] - 2, 0, len(origin)
    whole, part, spare = np.empty((3, 5)), np.empty((MOST_CORNERS, 5)), np.empty((MOST_CORNERS, 5))
    line, node = np.empty((MOST_CORNERS, 5)), np.empty((4, 4))
    corner = np.empty((3, 5))
    for p in range(len(pieces.triangle)):
        chart, place = pieces.chart[p], pieces.places[p]
        # squares that the piece may reach into: their corners move by less than half a texel
        left, right = _squares(place[:, 0], n)
        low, high = _squares(place[:, 1], n)
        whole[:, :2], whole[:, 2:] = place, np.eye(3)
        if not bent[chart, low:high, left:right].any():
            if count < room:
                origin[count], inside[count], places[count] = p, whole[:, 2:], place
            count += 1
            continue
        for i in range(low, high):
            for j in range(left, right):
                for k in range(4):
                    r, c = i + k // 2, j + (k + 1) // 2 % 2
                    _node(moved[chart], r, c, node[k])
                for t in range(2):
                    a, b, c = node[0], node[1 + t], node[2 + t]
                    corners = _side(whole, 3, a, b, line)
                    corners = _side(line, corners, b, c, spare)
                    corners = _side(spare, corners, c, a, part)
                    for m in range(1, corners - 1):
                        corner[0], corner[1], corner[2] = part[0], part[m], part[m + 1]
                        for k in range(3):
                            _carry(a, b, c, corner[k])
                        if area(corner, 3) < LEAST:
                            continue
                        if count < room:
                            origin[count], inside[count], places[count] = p, corner[:, 2:], corner[:, :2]
                        count += 1
    return count


@kernel
def _squares(x: Floats, n: int) -> tuple[int, int]:
    first, last = int(np.floor(x.min() * n)), int(np.floor(x.max() * n)) + 1
    return max(first - 1, 0), min(last + 2, n + 1)


@kernel
def _node(moved: Floats, row: int, column: int, node: Floats) -> None:
    """Where a node of the lattice lies, and where it lay: column and row, 0 to 1 across the chart."""
    n = len(moved) - 2
    node[2], node[3] = min(max(column - 0.5, 0.0), float(n)) / n, min(max(row - 0.5, 0.0), float(n)) / n
    node[0], node[1] = node[2] + moved[row, column, 0] / n, node[3] + moved[row, column, 1] / n


@kernel
def _side(corners: Floats, count: int, a: Floats, b: Floats, result: Floats) -> int:
    """Cut a convex polygon along the line from a to b, keep what lies left of it, and return its corners."""
    kept = 0
    for i in range(count):
        j = (i + 1) % count
        p = (b[0] - a[0]) * (corners[i, 1] - a[1]) - (b[1] - a[1]) * (corners[i, 0] - a[0])
        q = (b[0] - a[0]) * (corners[j, 1] - a[1]) - (b[1] - a[1]) * (corners[j, 0] - a[0])
        if p >= 0.0:
            result[kept] = corners[i]
            kept += 1
        if (p > 0.0 and q < 0.0) or (p < 0.0 and q > 0.0):
            t = p / (p - q)
            result[kept] = (1.0 - t) * corners[i] + t * corners[j]
            kept += 1
    return kept


@kernel
def _carry(a: Floats, b: Floats, c: Floats, place: Floats) -> None:
    """Take a place along with a triangle abc, from where its corners lie to where they lay."""
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    dx, dy = place[0] - a[0], place[1] - a[1]
    double = ux * vy - uy * vx
    s, t = (dx * vy - dy * vx) / double, (ux * dy - uy * dx) / double
    for k in range(2):
        place[k] = (1.0 - s - t) * a[2 + k] + s * b[2 + k] + t * c[2 + k]
