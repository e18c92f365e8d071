"""The triangles of a map onto charts, cut along the charts' borders."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Floats, Ints, kernel
from .frames import turned
from .layout import PatchMap
from .located import anchor, corners_in_frame_of
from .seamless import SeamlessMap, Transitions, transitions
from .wander import follow

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
