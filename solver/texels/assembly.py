"""The quads of a texel mesh in one compiled pass: link weights and areas of a surface that moves.

The formulas are those of `cells.quad`, in single precision: a moving surface needs them anew in every step. Differences
of positions are taken in double precision first, so that a surface far from the origin loses nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import Floats, Floats32, kernel
from .cells import HOURGLASS, LEAST_AREA, SHARE, UNEVEN

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
