"""The compiled loop over the quads of a surface that moves: their weights and areas."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import Floats, Floats32, kernel
from .cells import quad

# Least area of a cell over its area at rest: no density grows beyond a thousand times that at rest.
MIN_AREA_RATIO = np.float32(1e-3)

# Places of moving texels that are worked out at once, in whole rows: they stay in the fastest
# memory.
_BAND = 1024

# Numbers from one row of a band's results to the next, at least the width of a chart. A constant
# spares the compiler checks of whether the rows overlap: with too many checks it makes no wide
# loop.
_ROW = 2**14 + 16

# Numbers in single precision, which do not make other numbers double.
_ONE = np.float32(1)
_QUARTER = np.float32(0.25)
_ZERO = np.float32(0)


class QuadCells(NamedTuple):
    """The constant part of the quads of a surface that moves.

    Attributes
    ----------
    conductance : float32 [C, n + 2, n + 2]
        Coefficient at rest of the quad whose south-west corner is at each place; 0 where there is
        no quad.
    per_area : float32 [C, n + 2, n + 2]
        One over its area at rest, in units of 1 / scale^2.
    scale : float
        One over about the length of a quad at rest [1/m]: all numbers are then about 1.
    power : float
        Power of the area with which the coefficient goes.
    detours : float32 [4, C, n + 2, n + 2]
        See `link_detours`.
    """

    conductance: Floats32
    per_area: Floats32
    scale: float
    power: float
    detours: Floats32


_quad = kernel(inline="always")(quad)  # a loop over it is wide only if it is all in one piece


@kernel
def quad_pass(around: Floats, cells: QuadCells, weights: Floats, areas: Floats) -> None:
    """Fill in the weights [C, 4, n + 1, n + 1] and the areas [m^2], [C, n, n], from the quads.

    Coordinates are [3, C, n + 2, n + 2], with halo. Rows and charts follow one another in memory,
    so that a band is one loop over places. Places at the end of a row are no quads.
    """
    charts, width = cells.conductance.shape[:2]
    rows = max(_BAND // width, 1)
    places = around.reshape(3, -1)
    sides = np.zeros((7, _ROW), np.float32)
    below = np.zeros((2, width - 1), np.float32)
    # an array of its own, not one of the sides: loops over both would not be wide
    factor = np.zeros(rows * width, np.float32)
    for first in range(0, charts * width, rows):
        begin = first * width
        last = min(first + rows, charts * width)
        count = min(last * width, charts * width**2 - width - 1) - begin
        _weigh(places, begin, count, cells, sides)
        _scale(sides, cells, begin, count, factor)
        for row in range(first, last):
            chart = row // width
            r = row % width
            if r == 0:
                below[:] = 0
            if r < width - 1:
                _add_row(
                    sides,
                    row * width - begin,
                    below,
                    weights[chart],
                    areas[chart],
                    r,
                    cells.scale**2,
                )


@kernel(no_cpython_wrapper=True)
def _weigh(places: Floats, first: int, count: int, cells: QuadCells, sides: Floats32) -> None:
    """Geometric weights of the six links of quads at consecutive places, and their areas.

    Areas are in units of 1 / scale^2.
    Differences are taken in double precision, so that a surface far from the origin loses nothing.
    """
    scale = cells.scale
    above = first + cells.conductance.shape[1]
    detours = cells.detours.reshape(4, -1)
    flat = sides.reshape(-1)
    to_east = detours[0, first:]
    to_east_above = detours[0, above:]
    to_north = detours[1, first:]
    to_rise = detours[2, first:]
    to_fall = detours[3, first:]
    x = places[0, first:]
    y = places[1, first:]
    z = places[2, first:]
    x_above = places[0, above:]
    y_above = places[1, above:]
    z_above = places[2, above:]
    for c in range(count):
        ox = x[c]
        oy = y[c]
        oz = z[c]
        ex = scale * (x[c + 1] - ox)
        ey = scale * (y[c + 1] - oy)
        ez = scale * (z[c + 1] - oz)
        nx = scale * (x_above[c] - ox)
        ny = scale * (y_above[c] - oy)
        nz = scale * (z_above[c] - oz)
        px = scale * (x_above[c + 1] - ox)
        py = scale * (y_above[c + 1] - oy)
        pz = scale * (z_above[c + 1] - oz)
        south, north, west, east, rising, falling, area = _quad(
            (np.float32(ex), np.float32(ey), np.float32(ez)),
            (np.float32(nx), np.float32(ny), np.float32(nz)),
            (np.float32(px), np.float32(py), np.float32(pz)),
            (to_east[c], to_east_above[c], to_north[c], to_north[c + 1], to_rise[c], to_fall[c]),
        )
        flat[c] = south
        flat[c + _ROW] = north
        flat[c + 2 * _ROW] = west
        flat[c + 3 * _ROW] = east
        flat[c + 4 * _ROW] = rising
        flat[c + 5 * _ROW] = falling
        flat[c + 6 * _ROW] = area


@kernel(no_cpython_wrapper=True)
def _scale(sides: Floats32, cells: QuadCells, first: int, count: int, factor: Floats32) -> None:
    """Multiply the weights of a band by the coefficient, and the areas by a quarter.

    Both become 0 where there is no quad.
    """
    conductance = cells.conductance.reshape(-1)[first:]
    per_area = cells.per_area.reshape(-1)[first:]
    area = sides[6]
    power = np.float32(cells.power)
    for c in range(count):
        ratio = max(area[c] * per_area[c], MIN_AREA_RATIO)
        factor[c] = conductance[c] / ratio if power == -_ONE else conductance[c] * ratio**power
        area[c] = _QUARTER * area[c] if per_area[c] > 0 else _ZERO
    for k in range(6):
        row = sides[k]
        for c in range(count):
            row[c] = factor[c] * row[c] if conductance[c] > 0 else _ZERO


@kernel(no_cpython_wrapper=True)
def _add_row(
    sides: Floats32,
    begin: int,
    below: Floats32,
    weights: Floats,
    areas: Floats,
    r: int,
    unit: float,
) -> None:
    """Add a row of quads of a chart to its links and texels.

    `below` has the north sides and the areas of the row before. Areas are in units of 1 / unit.
    """
    size = below.shape[1]
    for c in range(size):
        i = begin + c
        weights[0, r, c] = below[0, c] + sides[0, i]
        weights[2, r, c] = sides[4, i]
        weights[3, r, c] = sides[5, i]
    weights[1, r, 0] = sides[2, begin]
    for c in range(1, size):
        i = begin + c
        weights[1, r, c] = sides[3, i - 1] + sides[2, i]
    if r > 0:
        for c in range(1, size):
            i = begin + c
            areas[r - 1, c - 1] = (
                (below[1, c - 1] + below[1, c]) + (sides[6, i - 1] + sides[6, i])
            ) / unit
    for c in range(size):
        i = begin + c
        below[0, c] = sides[1, i]
        below[1, c] = sides[6, i]
