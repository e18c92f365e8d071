"""The triangles of a map onto charts, cut along the charts' borders.

A chart map that follows texels which have left the centres of their squares.

The texel centres of a chart and its border are the nodes of a lattice of triangles. Moved nodes move the triangles, and
each is laid out again as it was: a texel is then found at its own row and column, wherever on the surface it lies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Bools, Floats, Ints, kernel
from .layout import PatchMap
from .samples import anchor, corners_in_frame_of
from .seamless import SeamlessMap, Transitions, follow, transitions, turned

LEAST = 1e-12  # area on a chart below which a piece is left out
MOST_CORNERS = 12


class Pieces(NamedTuple):
    """Parts of a mesh's triangles, each on one chart.

    Attributes
    ----------
    triangle : int64 [p]
        Of the mesh, in ascending order.
    barycentrics : float64 [p, 3, 3]
        Where in it the corners lie.
    chart : int64 [p]
    places : float64 [p, 3, 2]
        Column and row of the corners, 0 to 1 across the chart.
    """

    triangle: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    chart: NDArray[np.int64]
    places: NDArray[np.float64]


def chart_pieces(patches: PatchMap) -> Pieces:
    """Cut a map's triangles where they leave a chart."""
    seamless, across = patches.seamless, transitions(patches.seamless.glued)
    count = _cut(
        seamless, across, np.empty(0, np.int64), np.empty((0, 3, 3)), np.empty(0, np.int64), np.empty((0, 3, 2))
    )
    origin, weights = np.empty(count, np.int64), np.empty((count, 3, 3))
    chart, places = np.empty(count, np.int64), np.empty((count, 3, 2))
    _cut(seamless, across, origin, weights, chart, places)
    triangle = patches.surface.parent[origin]
    order = np.argsort(triangle, kind="stable")
    barycentrics = weights @ patches.surface.inside[origin]
    return Pieces(triangle[order], barycentrics[order], chart[order], np.clip(places[order], 0.0, 1.0))


@kernel
def _cut(seamless: SeamlessMap, across: Transitions, origin: Ints, weights: Floats, chart: Ints, places: Floats) -> int:
    """Fill in the pieces as far as there is room, and return how many there are."""
    count, room = 0, len(origin)
    p = np.empty((3, 2))
    whole, column, square = np.empty((MOST_CORNERS, 5)), np.empty((MOST_CORNERS, 5)), np.empty((MOST_CORNERS, 5))
    for f in range(len(seamless.F)):
        k = anchor(seamless, f)
        corners_in_frame_of(seamless, f, k, p)
        home = seamless.chart[seamless.F[f, k]]
        for j in range(3):
            whole[j, 0], whole[j, 1] = p[j]
            for i in range(3):
                whole[j, 2 + i] = 1.0 if i == j else 0.0
        left, right = _squares(p[:, 0])
        low, high = _squares(p[:, 1])
        for i in range(left, right):
            width = _between(whole, 3, 0, float(i), column)
            for j in range(low, high):
                corners = _between(column, width, 1, float(j), square)
                if corners < 3 or area(square, corners) < LEAST:
                    continue
                x, y = square[:corners, 0].mean(), square[:corners, 1].mean()
                target, turn, sx, sy, _, _ = follow(home, p[k, 0], p[k, 1], x, y, seamless.glued, across)
                for c in range(1, corners - 1):
                    if count < room:
                        origin[count], chart[count] = f, target
                        for to, of in ((0, 0), (1, c), (2, c + 1)):
                            weights[count, to] = square[of, 2:]
                            x, y = turned(square[of, 0], square[of, 1], turn)
                            places[count, to, 0], places[count, to, 1] = x + sx, y + sy
                    count += 1
    return count


@kernel
def _squares(x: Floats) -> tuple[int, int]:
    """First square of a row that numbers [3] reach into, and the one after the last; whole numbers lie on borders."""
    low, high = x.min(), x.max()
    first, last = int(np.floor(low + 1e-12)), int(np.ceil(high - 1e-12))
    return first, max(last, first + 1)


@kernel
def _between(corners: Floats, count: int, axis: int, low: float, result: Floats) -> int:
    """Cut a convex polygon at low and at low + 1 along an axis (Sutherland and Hodgman 1974); return its corners."""
    middle = np.empty((MOST_CORNERS, 5))
    count = _half(corners, count, axis, low, 1.0, middle)
    return _half(middle, count, axis, low + 1.0, -1.0, result)


@kernel
def _half(corners: Floats, count: int, axis: int, border: float, sign: float, result: Floats) -> int:
    kept = 0
    for i in range(count):
        j = (i + 1) % count
        a, b = sign * (corners[i, axis] - border), sign * (corners[j, axis] - border)
        if a >= 0.0:
            result[kept] = corners[i]
            kept += 1
        if (a > 0.0 and b < 0.0) or (a < 0.0 and b > 0.0):
            # from the same end for both triangles at an edge
            t = a / (a - b)
            result[kept] = (1.0 - t) * corners[i] + t * corners[j]
            result[kept, axis] = border
            kept += 1
    return kept


@kernel
def area(corners: Floats, count: int) -> float:
    """Area of a polygon whose first two columns are its places on a chart."""
    total = 0.0
    for i in range(count):
        j = (i + 1) % count
        total += 0.5 * (corners[i, 0] * corners[j, 1] - corners[i, 1] * corners[j, 0])
    return total


def warped(pieces: Pieces, offsets: NDArray[np.float64]) -> Pieces:
    """Pieces of a map whose texels have moved by `offsets` [C, n, n, 2] (column, row, in texels)."""
    moved = np.pad(offsets, ((0, 0), (1, 1), (1, 1), (0, 0)))
    # squares of the lattice of which a corner moves, [C, n + 1, n + 1]
    away = (moved != 0).any(axis=-1)
    bent = away[:, :-1, :-1] | away[:, 1:, :-1] | away[:, :-1, 1:] | away[:, 1:, 1:]
    size = _cut_triangles(pieces, moved, bent, np.empty(0, np.int64), np.empty((0, 3, 3)), np.empty((0, 3, 2)))
    origin, inside, places = np.empty(size, np.int64), np.empty((size, 3, 3)), np.empty((size, 3, 2))
    _cut_triangles(pieces, moved, bent, origin, inside, places)
    barycentrics = inside @ pieces.barycentrics[origin]
    return Pieces(pieces.triangle[origin], barycentrics, pieces.chart[origin], np.clip(places, 0.0, 1.0))


@kernel
def _cut_triangles(pieces: Pieces, moved: Floats, bent: Bools, origin: Ints, inside: Floats, places: Floats) -> int:
    """Fill in the parts of pieces as far as there is room, and return how many there are."""
    n, count, room = moved.shape[1] - 2, 0, len(origin)
    whole, part, spare = np.empty((3, 5)), np.empty((MOST_CORNERS, 5)), np.empty((MOST_CORNERS, 5))
    line, node = np.empty((MOST_CORNERS, 5)), np.empty((4, 4))
    corner = np.empty((3, 5))
    for p in range(len(pieces.triangle)):
        chart, place = pieces.chart[p], pieces.places[p]
        # squares that the piece may reach into: their corners move by less than half a texel
        left, right = _warped_squares(place[:, 0], n)
        low, high = _warped_squares(place[:, 1], n)
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
def _warped_squares(x: Floats, n: int) -> tuple[int, int]:
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
