"""The triangles of a map, cut along the charts' borders, and again where texels have moved.

The texel centres of a chart and its border are the nodes of a lattice of triangles. Moved nodes
move the triangles, and each is laid out again as it was: a texel is then found at its own row and
column, wherever on the surface it lies.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...kernel import Bools, Floats, Ints, kernel
from ...texels.texel_areas import MOST_CORNERS, clip
from .disks import signed_areas
from .layout import PatchMap
from .seamless import SeamlessMap, follow, places_on_charts, turned

# Area on a chart below which a piece is left out, unless it is the largest of its triangle.
_MIN_PIECE_AREA = 1e-12


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

    triangle: Ints
    barycentrics: Floats
    chart: Ints
    places: Floats


def chart_pieces(patches: PatchMap) -> Pieces:
    """Cut a map's triangles where they leave a chart."""
    seamless = patches.seamless
    corner, homes, z = places_on_charts(seamless)
    places = np.stack([z.real, z.imag], axis=-1)
    # squares of the plane that each reaches into, from one to that before another; whole numbers
    # lie on borders
    first = np.floor(places.min(axis=1) + 1e-12).astype(np.int64)
    last = np.maximum(np.ceil(places.max(axis=1) - 1e-12).astype(np.int64), first + 1)
    cut = _filled(_cut_at_borders, seamless, corner, homes, places, first, last)
    triangle = patches.surface.parent[cut.triangle]
    order = np.argsort(triangle, kind="stable")
    barycentrics = cut.barycentrics @ patches.surface.inside[cut.triangle]
    return _with_areas(
        Pieces(
            triangle[order],
            barycentrics[order],
            cut.chart[order],
            np.clip(cut.places[order], 0.0, 1.0),
        )
    )


def _with_areas(pieces: Pieces) -> Pieces:
    """The pieces that have an area on their chart.

    Cuts that meet in a corner, or run along a side, leave pieces without one.
    """
    areas = signed_areas(pieces.places)
    largest = np.zeros(int(pieces.triangle[-1]) + 1)
    np.maximum.at(largest, pieces.triangle, areas)
    kept = areas >= np.minimum(largest[pieces.triangle], _MIN_PIECE_AREA)
    kept &= areas > 0.0
    return Pieces._make(array[kept] for array in pieces)


def _filled(cut: Any, *given: Any) -> Pieces:
    """Pieces that a cut makes of some triangles, in any order."""
    size = 0
    while True:  # once to count them, once to fill them in
        triangle, chart = np.empty((2, size), np.int64)
        room = Pieces(triangle, np.empty((size, 3, 3)), chart, np.empty((size, 3, 2)))
        count = cut(*given, room)
        if count == size:
            return room
        size = count


@kernel
def _cut_at_borders(
    seamless: SeamlessMap,
    corner: Ints,
    homes: Ints,
    seen: Floats,
    first: Ints,
    last: Ints,
    room: Pieces,
) -> int:
    """Fill in the pieces as far as there is room, and return how many there are."""
    count = 0
    whole = np.empty((3, 5))
    spare = np.empty((MOST_CORNERS, 5))
    column = np.empty((MOST_CORNERS, 5))
    square = np.empty((MOST_CORNERS, 5))
    for f in range(len(seen)):
        k = corner[f]
        p = seen[f]
        _fill_in(p, whole)
        for i in range(first[f, 0], last[f, 0]):
            width = clip(whole, 3, float(i), 0.0, 1.0, 0.0, 0, spare)
            width = clip(spare, width, i + 1.0, 0.0, -1.0, 0.0, 0, column)
            for j in range(first[f, 1], last[f, 1]):
                corners = clip(column, width, 0.0, float(j), 0.0, 1.0, 1, spare)
                corners = clip(spare, corners, 0.0, j + 1.0, 0.0, -1.0, 1, square)
                if corners < 3 or not _area(square, corners) > 0.0:
                    continue
                middle = 0j
                for c in range(corners):
                    middle += complex(square[c, 0], square[c, 1])
                target, (turn, shift), _ = follow(
                    seamless, homes[f], complex(p[k, 0], p[k, 1]), middle / corners
                )
                for c in range(1, corners - 1):
                    if count < len(room.chart):
                        room.triangle[count] = f
                        room.chart[count] = target
                        for to in range(3):
                            of = c + to - 1 if to > 0 else 0
                            for m in range(3):
                                room.barycentrics[count, to, m] = square[of, 2 + m]
                            place = turned(complex(square[of, 0], square[of, 1]), turn) + shift
                            room.places[count, to, 0] = place.real
                            room.places[count, to, 1] = place.imag
                    count += 1
    return count


@kernel
def _fill_in(places: Floats, whole: Floats) -> None:
    """Places [3, 2] and barycentrics of a triangle's corners, together [3, 5].

    Slices compile slowly.
    """
    for k in range(3):
        whole[k, 0] = places[k, 0]
        whole[k, 1] = places[k, 1]
        for m in range(3):
            whole[k, 2 + m] = 1.0 if m == k else 0.0


@kernel
def _area(corners: Floats, count: int) -> float:
    """Area of a polygon whose first two columns are its places on a chart."""
    total = 0.0
    for i in range(count):
        j = (i + 1) % count
        total += 0.5 * (corners[i, 0] * corners[j, 1] - corners[i, 1] * corners[j, 0])
    return total


def warped(pieces: Pieces, offsets: Floats) -> Pieces:
    """Pieces of a map whose texels have moved by `offsets` [C, n, n, 2] (column, row) [texels]."""
    n = offsets.shape[1]
    moved = np.pad(offsets, ((0, 0), (1, 1), (1, 1), (0, 0)))
    # squares of the lattice of which a corner moves, [C, n + 1, n + 1]
    away = (moved != 0).any(axis=-1)
    bent = away[:, :-1, :-1] | away[:, 1:, :-1] | away[:, :-1, 1:] | away[:, 1:, 1:]
    # where each node of the lattice lies, and where it lay: column and row, 0 to 1 across the chart
    line = np.clip(np.arange(n + 2) - 0.5, 0.0, n) / n
    lay = np.broadcast_to(np.stack(np.meshgrid(line, line), axis=-1), moved.shape)
    nodes = np.concatenate([lay + moved / n, lay], axis=-1)
    # squares that a piece may reach into: their corners move by less than half a texel
    first = np.maximum(np.floor(pieces.places.min(axis=1) * n).astype(np.int64) - 1, 0)
    last = np.minimum(np.floor(pieces.places.max(axis=1) * n).astype(np.int64) + 3, n + 1)
    cut = _filled(_cut_at_lattice, pieces, nodes, bent, first, last)
    barycentrics = cut.barycentrics @ pieces.barycentrics[cut.triangle]
    return _with_areas(
        Pieces(
            pieces.triangle[cut.triangle], barycentrics, cut.chart, np.clip(cut.places, 0.0, 1.0)
        )
    )


@kernel
def _cut_at_lattice(
    pieces: Pieces, nodes: Floats, bent: Bools, first: Ints, last: Ints, room: Pieces
) -> int:
    """Fill in the parts of pieces as far as there is room, and return how many there are."""
    count = 0
    whole = np.empty((3, 5))
    corner = np.empty((3, 5))
    node = np.empty((4, 4))
    part = np.empty((MOST_CORNERS, 5))
    spare = np.empty((MOST_CORNERS, 5))
    for p in range(len(pieces.triangle)):
        home = pieces.chart[p]
        place = pieces.places[p]
        left = first[p, 0]
        right = last[p, 0]
        low = first[p, 1]
        high = last[p, 1]
        _fill_in(place, whole)
        if not bent[home, low:high, left:right].any():
            if count < len(room.chart):
                room.triangle[count] = p
                room.chart[count] = home
                room.barycentrics[count] = whole[:, 2:]
                room.places[count] = place
            count += 1
            continue
        for i in range(low, high):
            for j in range(left, right):
                for k in range(4):
                    node[k] = nodes[home, i + k // 2, j + (k + 1) // 2 % 2]
                for t in range(2):
                    a = node[0]
                    b = node[1 + t]
                    c = node[2 + t]
                    corners = clip(whole, 3, a[0], a[1], a[1] - b[1], b[0] - a[0], -1, part)
                    corners = clip(part, corners, b[0], b[1], b[1] - c[1], c[0] - b[0], -1, spare)
                    corners = clip(spare, corners, c[0], c[1], c[1] - a[1], a[0] - c[0], -1, part)
                    ux = b[0] - a[0]
                    uy = b[1] - a[1]
                    vx = c[0] - a[0]
                    vy = c[1] - a[1]
                    double = ux * vy - uy * vx
                    for m in range(1, corners - 1):
                        corner[0] = part[0]
                        corner[1] = part[m]
                        corner[2] = part[m + 1]
                        for k in range(3):
                            # taken along with the triangle abc, from where its corners lie to where
                            # they lay
                            dx = corner[k, 0] - a[0]
                            dy = corner[k, 1] - a[1]
                            s = (dx * vy - dy * vx) / double
                            r = (ux * dy - uy * dx) / double
                            corner[k, 0] = (1.0 - s - r) * a[2] + s * b[2] + r * c[2]
                            corner[k, 1] = (1.0 - s - r) * a[3] + s * b[3] + r * c[3]
                        if not _area(corner, 3) > 0.0:
                            continue
                        if count < len(room.chart):
                            room.triangle[count] = p
                            room.chart[count] = home
                            room.barycentrics[count] = corner[:, 2:]
                            room.places[count] = corner[:, :2]
                        count += 1
    return count
