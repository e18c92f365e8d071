"""The quads of a texel mesh in one compiled pass: link weights and areas of a surface that moves.

The formulas are those of `cells.quad`, in single precision: a moving surface needs them anew in every step. Differences
of positions are taken in double precision first, so that a surface far from the origin loses nothing.

What special cells add where their corners lie: one compiled loop for all cells of a kind.

The few cells of a texel mesh that are no plain quads: strips at rims, triangles and polygons in corners.

Where they lie and what they add to is worked out once; for a surface that moves, one compiled loop then does all of a
kind together.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Floats32, Ints, kernel
from .cells import HOURGLASS, LEAST_AREA, SHARE, UNEVEN, polygon, quad, quad_area, strip, triangle
from .stencil import CrossingLinks
from .topology import TRIANGLE, TexelTopology


class Added(NamedTuple):
    """What cells add: geometric weights of their links [k, l], shares of the area [k, j] and areas [k] [m^2]."""

    links: Floats
    shares: Floats
    areas: Floats


@kernel
def fill_quads(places: Floats, corners: Ints, added: Added) -> None:
    """Whole quads: six links, and a quarter of the area each."""
    for i in range(len(corners)):
        a, b, c, d = _quad(places, corners[i])
        south, north, west, east, rising, falling, area = quad(a, b, c, d)
        links = added.links[i]
        links[0], links[1], links[2], links[3], links[4], links[5] = south, north, west, east, rising, falling
        added.shares[i] = area / 4
        added.areas[i] = area


@kernel
def fill_areas(places: Floats, corners: Ints, added: Added) -> None:
    """Quads without links."""
    for i in range(len(corners)):
        a, b, c, d = _quad(places, corners[i])
        area = quad_area(a, b, c, d)
        added.shares[i] = area / 4
        added.areas[i] = area


@kernel
def fill_strips(places: Floats, corners: Ints, added: Added) -> None:
    """Strips: the link of their first two corners."""
    for i in range(len(corners)):
        a, b, c, d = _quad(places, corners[i])
        added.links[i, 0] = strip(a, b, c, d)
        added.areas[i] = quad_area(a, b, c, d)


@kernel
def fill_triangles(places: Floats, corners: Ints, added: Added) -> None:
    """Triangles, as their first corner's chart sees them: two links, and its share."""
    for i in range(len(corners)):
        a, b, c = _at(places, corners[i, 0]), _at(places, corners[i, 1]), _at(places, corners[i, 2])
        _, added.links[i, 0], added.links[i, 1], area = triangle(a, b, c)
        added.shares[i, 0] = area / 3
        added.areas[i] = area


@kernel
def fill_polygons(places: Floats, corners: Ints, added: Added) -> None:
    """Polygons: the links between all pairs of corners."""
    count = corners.shape[1]
    points = np.empty((count, 3))
    for i in range(len(corners)):
        for j in range(count):
            for k in range(3):
                points[j, k] = places[k, corners[i, j]]
        weights, shares = polygon(points)
        link = 0
        for a in range(count):
            for b in range(a + 1, count):
                added.links[i, link] = weights[a, b]
                link += 1
        added.shares[i] = shares
        added.areas[i] = shares.sum()


@kernel
def _at(places: Floats, i: int) -> tuple[float, float, float]:
    """A place among coordinates [3, p]."""
    return places[0, i], places[1, i], places[2, i]


@kernel
def _quad(places: Floats, corners: Ints) -> tuple[Any, Any, Any, Any]:
    """The four corners of a quad."""
    return _at(places, corners[0]), _at(places, corners[1]), _at(places, corners[2]), _at(places, corners[3])


_HALF, _QUARTER, _TWO = np.float32(0.5), np.float32(0.25), np.float32(2)
_ZERO, _ONE, _THREE, _FOUR = np.float32(0), np.float32(1), np.float32(3), np.float32(4)
_HOURGLASS, _SHARE, _UNEVEN, _LEAST = map(np.float32, (HOURGLASS, SHARE, UNEVEN, LEAST_AREA))
_SLIGHTEST = np.float32(1e-12)  # in units of a quad at rest

# Area of a cell over that at rest, at least: no density grows beyond a thousand times that at rest.
LEAST_RATIO = np.float32(1e-3)


# Places that are worked on at once, in whole rows: what is known of them stays in the fastest memory.
_BAND = 1024


class QuadCells(NamedTuple):
    """What does not change while the quads move.

    Attributes
    ----------
    conductance : float32 [C, n + 2, n + 2]
        Coefficient at rest of the quad whose south-west corner is at each place, 0 where there is none.
    per_area : float32 [C, n + 2, n + 2]
        One over its area at rest, in units of 1 / scale^2.
    scale : float
        One over the length of a quad at rest, about: all that is computed is then about 1.
    power : float
        With which the coefficient goes with the area.
    """

    conductance: Floats32
    per_area: Floats32
    scale: float
    power: float


@kernel
def quad_pass(around: Floats, cells: QuadCells, weights: Floats, areas: Floats) -> None:
    """Fill in what the quads give to the weights [C, 4, n + 1, n + 1] and the texels' areas [m^2], [C, n, n].

    Coordinates are [3, C, n + 2, n + 2], with halo. Rows and charts follow one another in memory, so that a band is one
    loop over places; those at the end of a row are no quads.
    """
    charts, width = cells.conductance.shape[:2]
    rows = max(_BAND // width, 1)
    places, sides = around.reshape(3, -1), np.zeros((7, rows * width), np.float32)
    below = np.zeros((2, width - 1), np.float32)
    coefficient = np.zeros(rows * width, np.float32)  # not one of the sides: loops over both would not be wide
    for first in range(0, charts * width, rows):
        begin, last = first * width, min(first + rows, charts * width)
        count = min(last * width, charts * width**2 - width - 1) - begin
        _geometry(places, begin, count, cells, sides)
        _scale(sides, cells, begin, count, coefficient)
        for row in range(first, last):
            chart, r = row // width, row % width
            if r == 0:
                below[:] = 0
            if r < width - 1:
                _add_row(sides, row * width - begin, below, weights[chart], areas[chart], r, cells.scale**2)


@kernel
def _geometry(places: Floats, first: int, count: int, cells: QuadCells, sides: Floats32) -> None:
    """Geometric weights of the six links of the quads of consecutive places, and their areas times scale squared."""
    scale, above = cells.scale, first + cells.conductance.shape[1]
    x, y, z = places[0, first:], places[1, first:], places[2, first:]
    x_above, y_above, z_above = places[0, above:], places[1, above:], places[2, above:]
    for c in range(count):
        # differences from the south-west corner
        ox, oy, oz = x[c], y[c], z[c]
        ex, ey, ez = (
            np.float32(scale * (x[c + 1] - ox)),
            np.float32(scale * (y[c + 1] - oy)),
            np.float32(scale * (z[c + 1] - oz)),
        )
        nx, ny, nz = (
            np.float32(scale * (x_above[c] - ox)),
            np.float32(scale * (y_above[c] - oy)),
            np.float32(scale * (z_above[c] - oz)),
        )
        px, py, pz = (
            np.float32(scale * (x_above[c + 1] - ox)),
            np.float32(scale * (y_above[c + 1] - oy)),
            np.float32(scale * (z_above[c + 1] - oz)),
        )
        qx, qy, qz = nx - ex, ny - ey, nz - ez
        pp, qq, pq = px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz, px * qx + py * qy + pz * qz
        cx, cy, cz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        cross = np.sqrt(cx * cx + cy * cy + cz * cz)
        both = pp + qq
        twice = max(_TWO * max(cross, _HALF * _LEAST * both), _SLIGHTEST)
        half_area = _HALF * twice
        # the way between the diagonals' middles, twice; next to none in a parallelogram
        wx, wy, wz = px - ex - nx, py - ey - ny, pz - ez - nz
        along_p, along_q = wx * px + wy * py + wz * pz, wx * qx + wy * qy + wz * qz
        square = half_area * half_area
        a, b = (along_p * qq - along_q * pq) / square, (along_q * pp - along_p * pq) / square
        uneven = a * a + b * b
        share = uneven / (uneven + _UNEVEN)
        a, b = min(max(share * a, -_ONE), _ONE), min(max(share * b, -_ONE), _ONE)
        hourglass, skew = _hourglass(pp, qq, pq, _HALF * half_area), pq / twice
        sides[0, c] = skew + hourglass * (_ONE + a) * (_ONE - b)
        sides[1, c] = skew + hourglass * (_ONE - a) * (_ONE + b)
        sides[2, c] = hourglass * (_ONE + a) * (_ONE + b) - skew
        sides[3, c] = hourglass * (_ONE - a) * (_ONE - b) - skew
        sides[4, c] = qq / twice - hourglass * (_ONE - a * a)
        sides[5, c] = pp / twice - hourglass * (_ONE - b * b)
        # the smaller triangulation; e, n and p are the other corners
        rising = _cross_length(ex, ey, ez, px, py, pz) + _cross_length(px, py, pz, nx, ny, nz)
        falling = _cross_length(ex, ey, ez, nx, ny, nz) + _cross_length(px - ex, py - ey, pz - ez, qx, qy, qz)
        sides[6, c] = min(rising, falling) / _TWO


@kernel
def _cross_length(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> float:
    """Length of the vector product."""
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return np.sqrt(x * x + y * y + z * z)


@kernel
def _hourglass(pp: np.float32, qq: np.float32, pq: np.float32, area: np.float32) -> np.float32:
    """Hourglass stiffness; see `cells._hourglass`."""
    both_sides = max((pp + qq) * _HALF, _SLIGHTEST)
    a, d = (both_sides + abs(pq)) * _HALF, (pp - qq) * _QUARTER
    in_time = both_sides * area / (_TWO * (area * area + _THREE * d * d))
    free = (a * a - d * d) / (_FOUR * a * area)
    return min(in_time, max(_SHARE * free, _HOURGLASS * _TWO * area / both_sides))


@kernel
def _scale(sides: Floats32, cells: QuadCells, first: int, count: int, coefficient: Floats32) -> None:
    """Multiply the weights of a band by what the coefficient has become; leave a quarter of the areas.

    Both are cleared where there is no quad.
    """
    conductance, per_area = cells.conductance.reshape(-1)[first:], cells.per_area.reshape(-1)[first:]
    area, power = sides[6], np.float32(cells.power)
    for c in range(count):
        ratio = max(area[c] * per_area[c], LEAST_RATIO)
        coefficient[c] = conductance[c] / ratio if power == -_ONE else conductance[c] * ratio**power
        area[c] = _QUARTER * area[c] if per_area[c] > 0 else _ZERO
    for k in range(6):
        row = sides[k]
        for c in range(count):
            row[c] = coefficient[c] * row[c] if conductance[c] > 0 else _ZERO


@kernel
def _add_row(sides: Floats32, begin: int, below: Floats32, weights: Floats, areas: Floats, r: int, unit: float) -> None:
    """Give a chart's row of weights and areas to links and texels; `below` has north sides and areas of the last.

    Areas are in units of 1 / unit.
    """
    size = below.shape[1]
    for c in range(size):
        i = begin + c
        weights[0, r, c] = below[0, c] + sides[0, i]
        weights[2, r, c], weights[3, r, c] = sides[4, i], sides[5, i]
    weights[1, r, 0] = sides[2, begin]
    for c in range(1, size):
        i = begin + c
        weights[1, r, c] = sides[3, i - 1] + sides[2, i]
    if r > 0:
        for c in range(1, size):
            i = begin + c
            areas[r - 1, c - 1] = ((below[1, c - 1] + below[1, c]) + (sides[6, i - 1] + sides[6, i])) / unit
    for c in range(size):
        i = begin + c
        below[0, c], below[1, c] = sides[1, i], sides[6, i]


_CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
# the links of a cell at (r, c), in the order of `quad`: link, and the place where it is stored
_LINKS = ((0, 0, 0), (0, 1, 0), (1, 0, 0), (1, 0, 1), (2, 0, 0), (3, 0, 0))
# two corners of a strip on the surface, the two beyond the rim opposite to them, and the link of the first two
_STRIPS = ((0, 1, 2, 3, 0), (2, 3, 0, 1, 1), (0, 2, 1, 3, 2), (1, 3, 0, 2, 3))


@dataclasses.dataclass(frozen=True, eq=False)
class SpecialCells:
    """Cells of one kind.

    Attributes
    ----------
    corners : int64 [k, j]
        Flat places of their corners in a field with halo.
    fill : kernel
        Fills in what they add, from coordinates [3, p] of all places [m] and the corners.
    counts : (int, int)
        How many links, and shares, a cell has.
    links : (int64 [m], int64 [m])
        Of their weights [k, l], flat, those that are added, and the flat places among a stencil's weights.
    shares : (int64 [s], int64 [s])
        Likewise of the shares, and flat texels.
    irregular : (int64 [i], int64 [i, 2])
        Likewise weights of links beyond the nine points, and the texels at both ends.
    on_all_copies : bool
        Whether what they add to a link that crosses a glued side is listed for each of its copies.
    """

    corners: Ints
    fill: Callable[[Floats, Ints, Added], None]
    counts: tuple[int, int]
    links: tuple[Ints, Ints]
    shares: tuple[Ints, Ints]
    irregular: tuple[Ints, Ints] = (np.zeros(0, np.int64), np.zeros((0, 2), np.int64))
    on_all_copies: bool = False

    def weigh(self, places: Floats) -> Added:
        """What they add where the places of a field with halo lie at coordinates [3, p] [m]."""
        count, (links, shares) = len(self.corners), self.counts
        added = Added(np.empty((count, links)), np.empty((count, shares)), np.empty(count))
        self.fill(places, self.corners, added)
        return added


def special_cells(topology: TexelTopology, halo_positions: Floats) -> list[SpecialCells]:
    """All cells of a texel mesh but the quads between four texels."""
    return [
        each
        for kind in (_rim_cells(topology, halo_positions), _triangles(topology), _polygons(topology))
        for each in kind
        if len(each.corners)
    ]


def whole_quads(topology: TexelTopology) -> NDArray[np.bool_]:
    """The quads between four texels, none of them beyond a rim, [C, n + 1, n + 1]."""
    there = (topology.halo >= 0) & ~topology.rim
    return there[:, :-1, :-1] & there[:, :-1, 1:] & there[:, 1:, :-1] & there[:, 1:, 1:]


def _rim_cells(topology: TexelTopology, halo_positions: Floats) -> Iterator[SpecialCells]:
    """Strips of half a texel between the last texels and a rim; see `cell_sums`."""
    halo, rim, width = topology.halo, topology.rim, topology.halo.shape[1]
    places = np.arange(halo.size).reshape(halo.shape)
    corners = np.stack([places[:, r : width - 1 + r, c : width - 1 + c] for r, c in _CORNERS], axis=-1)
    exists = (halo.reshape(-1)[corners] >= 0).all(-1) & rim.reshape(-1)[corners].any(-1)
    exists &= np.isfinite(halo_positions.reshape(-1, 3)[corners]).all((-1, -2))
    cell = np.argwhere(exists)
    corners = corners[exists]
    at_rim, shown = rim.reshape(-1)[corners], halo.reshape(-1)[corners]
    belongs = np.broadcast_to(np.arange(4), corners.shape).copy()
    for i in range(4):
        for j in range(4):
            belongs[at_rim[:, i] & ~at_rim[:, j] & (shown[:, i] == shown[:, j]), i] = j
    texels = _own_texels(topology, np.take_along_axis(corners, belongs, axis=1))
    shares = np.flatnonzero(texels.ravel() >= 0), texels.ravel()[texels.ravel() >= 0]
    if topology.fixed_rim:
        yield SpecialCells(corners, fill_quads, (6, 4), _link_places(topology, cell, _LINKS), shares)
        return
    nothing = np.zeros(0, np.int64), np.zeros(0, np.int64)
    yield SpecialCells(corners, fill_areas, (0, 4), nothing, shares)
    for i, j, p, q, link in _STRIPS:
        here = ~at_rim[:, i] & ~at_rim[:, j] & at_rim[:, p] & at_rim[:, q]
        strips = corners[here][:, [i, j, p, q]]
        yield SpecialCells(strips, fill_strips, (1, 0), _link_places(topology, cell[here], (_LINKS[link],)), nothing)


def _triangles(topology: TexelTopology) -> Iterator[SpecialCells]:
    """The cells in corners of three charts; each chart adds what its own texel there has of it."""
    n = topology.shape[1]
    places = np.arange(topology.halo.size).reshape(topology.halo.shape)
    for corner, (r, c) in enumerate(((0, 0), (0, n), (n, n), (n, 0))):
        chart = np.flatnonzero(topology.valence[:, corner] == TRIANGLE)
        r0, r1 = (1, 0) if r == 0 else (r, r + 1)
        c0, c1 = (1, 0) if c == 0 else (c, c + 1)
        corners = np.stack([places[chart, r0, c0], places[chart, r0, c1], places[chart, r1, c0]], axis=1)
        cell = np.stack([chart, np.full_like(chart, r), np.full_like(chart, c)], axis=1)
        links = _LINKS[2 + (c == 0)], _LINKS[r == 0]  # along the column and along the row
        own = np.arange(len(chart)), topology.halo.reshape(-1)[corners[:, 0]]
        yield SpecialCells(corners, fill_triangles, (2, 1), _link_places(topology, cell, links), own)


def _polygons(topology: TexelTopology) -> Iterator[SpecialCells]:
    """Polygons by their number of corners: their sides belong to the nine points, their diagonals do not."""
    crossing = CrossingLinks.of(topology)
    order = np.argsort(crossing.keys, kind="stable")
    keys, n = crossing.keys[order], topology.shape[1]
    places = np.ravel_multi_index(crossing.places, (topology.shape[0], 4, n + 1, n + 1))[order]
    for count in sorted({len(each) for each in topology.polygons}):
        texels = np.stack([each for each in topology.polygons if len(each) == count])
        pairs = np.stack([texels[:, each] for each in np.triu_indices(count, 1)], axis=-1).reshape(-1, 2)
        wanted = pairs.min(axis=1) * crossing.size + pairs.max(axis=1)
        first, last = np.searchsorted(keys, wanted), np.searchsorted(keys, wanted, side="right")
        copies = last - first
        source = np.repeat(np.arange(len(pairs)), copies)
        nth = np.arange(len(source)) - np.repeat(np.cumsum(copies) - copies, copies)
        beside = np.flatnonzero(copies == 0)
        yield SpecialCells(
            topology.addresses.texels[texels],
            fill_polygons,
            (count * (count - 1) // 2, count),
            (source, places[first[source] + nth]),
            (np.arange(texels.size), texels.ravel()),
            (beside, pairs[beside]),
            on_all_copies=True,
        )


def _own_texels(topology: TexelTopology, places: Ints) -> Ints:
    """Flat texels at places that are a chart's own, -1 elsewhere."""
    return np.where(topology.own.reshape(-1)[places], topology.halo.reshape(-1)[places], -1)


def _link_places(topology: TexelTopology, cell: Ints, links: tuple[tuple[int, int, int], ...]) -> tuple[Ints, Ints]:
    """Of links of cells [k, 3] (chart, row, column), flat, those that are stored, and where in a stencil's weights."""
    charts, n, _ = topology.shape
    chart, r, c = cell.T
    at = [(r + down, c + right) for _, down, right in links]
    stored = np.stack([(row <= n) & (column <= n) for row, column in at], axis=1)
    shape = charts, 4, n + 1, n + 1
    flat = [
        np.ravel_multi_index((chart, np.full_like(chart, link), row, column), shape, mode="clip")
        for (link, _, _), (row, column) in zip(links, at, strict=True)
    ]
    return np.flatnonzero(stored.ravel()), np.stack(flat, axis=1)[stored]
