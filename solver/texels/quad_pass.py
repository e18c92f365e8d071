"""The quads of a texel mesh in one compiled pass: link weights and areas of a surface that moves.

The formulas are those of `cells.quad`, in single precision: a moving surface needs them anew in every step. Differences
of positions are taken in double precision first, so that a surface far from the origin loses nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Floats, Floats32, kernel

from .cells import HOURGLASS, LEAST_AREA, SHARE, UNEVEN

_HALF, _QUARTER, _TWO = np.float32(0.5), np.float32(0.25), np.float32(2)
_ZERO, _ONE, _THREE, _FOUR = np.float32(0), np.float32(1), np.float32(3), np.float32(4)
_HOURGLASS, _SHARE, _UNEVEN, _LEAST = map(np.float32, (HOURGLASS, SHARE, UNEVEN, LEAST_AREA))
_SLIGHTEST = np.float32(1e-12)  # in units of a quad at rest

# Area of a cell over that at rest, at least: no density grows beyond a thousand times that at rest.
LEAST_RATIO = np.float32(1e-3)


class QuadCells(NamedTuple):
    """What does not change while the quads move.

    Attributes
    ----------
    conductance : float32 [C, n + 1, n + 1]
        Coefficient of each quad at rest, 0 where there is none.
    per_area : float32 [C, n + 1, n + 1]
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
def quad_pass(x: Floats, y: Floats, z: Floats, cells: QuadCells, weights: Floats, areas: Floats) -> None:
    """Fill in what the quads give to the weights [C, 4, n + 1, n + 1] and the texels' areas [m^2], [C, n, n].

    The positions x, y, z are [C, n + 2, n + 2] each, with halo.
    """
    charts, size = cells.conductance.shape[:2]
    sides = np.zeros((7, size), np.float32)
    below = np.zeros((2, size), np.float32)
    for chart in range(charts):
        below[:] = 0
        for r in range(size):
            _row(x[chart, r : r + 2], y[chart, r : r + 2], z[chart, r : r + 2], cells.scale, sides)
            _scale(cells, chart, r, sides)
            _add_row(sides, below, weights[chart], areas[chart], r)
    for chart in range(charts):
        for r in range(size - 1):
            for c in range(size - 1):
                areas[chart, r, c] /= cells.scale**2


@kernel
def _row(x: Floats, y: Floats, z: Floats, scale: float, sides: Floats32) -> None:
    """Geometry of a row of quads between two rows of places: weights of the six links, and area times scale squared."""
    for c in range(sides.shape[1]):
        # differences from the south-west corner
        ox, oy, oz = x[0, c], y[0, c], z[0, c]
        ex, ey, ez = (
            np.float32(scale * (x[0, c + 1] - ox)),
            np.float32(scale * (y[0, c + 1] - oy)),
            np.float32(scale * (z[0, c + 1] - oz)),
        )
        nx, ny, nz = (
            np.float32(scale * (x[1, c] - ox)),
            np.float32(scale * (y[1, c] - oy)),
            np.float32(scale * (z[1, c] - oz)),
        )
        px, py, pz = (
            np.float32(scale * (x[1, c + 1] - ox)),
            np.float32(scale * (y[1, c + 1] - oy)),
            np.float32(scale * (z[1, c + 1] - oz)),
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
def _scale(cells: QuadCells, chart: int, r: int, sides: Floats32) -> None:
    """Multiply the weights of a row by what the coefficient has become; clear what is no quad."""
    for c in range(sides.shape[1]):
        rest, per_area = cells.conductance[chart, r, c], cells.per_area[chart, r, c]
        ratio = max(sides[6, c] * per_area, LEAST_RATIO)
        coefficient = rest / ratio if cells.power == -1 else rest * ratio ** np.float32(cells.power)
        for k in range(6):
            sides[k, c] = coefficient * sides[k, c] if rest > 0 else _ZERO
        sides[6, c] = _QUARTER * sides[6, c] if per_area > 0 else _ZERO


@kernel
def _add_row(sides: Floats32, below: Floats32, weights: Floats, areas: Floats, r: int) -> None:
    """Give a row's weights and areas to links and texels; `below` holds north sides and areas of the row below."""
    size = sides.shape[1]
    for c in range(size):
        weights[0, r, c] = below[0, c] + sides[0, c]
        weights[2, r, c], weights[3, r, c] = sides[4, c], sides[5, c]
    weights[1, r, 0] = sides[2, 0]
    for c in range(1, size):
        weights[1, r, c] = sides[3, c - 1] + sides[2, c]
    if r > 0:
        for c in range(1, size):
            areas[r - 1, c - 1] = (below[1, c - 1] + below[1, c]) + (sides[6, c - 1] + sides[6, c])
    for c in range(size):
        below[0, c], below[1, c] = sides[1, c], sides[6, c]
