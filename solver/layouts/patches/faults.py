"""Texels between their neighbours on a surface: how far from being folded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernel import Bools, Floats, Ints, kernel

_MARGIN = 0.1  # sine of a corner that is wide enough


class Texels(NamedTuple):
    """Texels that move."""

    halo: Ints  # [C, n + 2, n + 2]
    rim: Bools
    beyond: Floats  # [C, n + 2, n + 2, 3] [m]; beyond a rim, else NaN
    positions: Floats  # [C n^2, 3] [m]
    normals: Floats  # [C n^2, 3]
    offsets: Ints  # [C, n + 2, n + 2, 2], column and row, in places of the lattice; 0 in the halo


@kernel(inline="always")
def _place(texels: Texels, chart: int, row: int, column: int) -> Floats:
    if texels.rim[chart, row, column] or texels.halo[chart, row, column] < 0:
        return texels.beyond[chart, row, column]
    return texels.positions[texels.halo[chart, row, column]]


@kernel
def _fault(texels: Texels, flat: int) -> float:
    """How badly the four corners of a texel between its neighbours face outwards: 1 and more if one is folded."""
    n = texels.halo.shape[1] - 2
    chart, row, column = flat // (n * n), flat // n % n + 1, flat % n + 1
    o, normal = texels.positions[flat], texels.normals[flat]
    fault = 0.0
    for k in range(4):
        i, j = (0, 1) if k == 0 else ((1, 0) if k == 1 else ((0, -1) if k == 2 else (-1, 0)))
        p, q = _place(texels, chart, row + i, column + j), _place(texels, chart, row + j, column - i)
        ax, ay, az, bx, by, bz = p[0] - o[0], p[1] - o[1], p[2] - o[2], q[0] - o[0], q[1] - o[1], q[2] - o[2]
        facing = (ay * bz - az * by) * normal[0] + (az * bx - ax * bz) * normal[1] + (ax * by - ay * bx) * normal[2]
        size = np.sqrt((ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz))
        # NaN, where there is no neighbour, is not below the margin
        if facing < _MARGIN * size:
            fault += (1.0 if facing < 0.0 else 0.0) + (_MARGIN - facing / max(size, 1e-300)) ** 2
    return fault


@kernel
def faults(texels: Texels, flat: int) -> float:
    """Of a texel and its four neighbours."""
    n = texels.halo.shape[1] - 2
    chart, row, column = flat // (n * n), flat // n % n + 1, flat % n + 1
    total = _fault(texels, flat)
    for k in range(4):
        i, j = (0, 1) if k == 0 else ((1, 0) if k == 1 else ((0, -1) if k == 2 else (-1, 0)))
        other = texels.halo[chart, row + i, column + j]
        if other >= 0 and not texels.rim[chart, row + i, column + j]:
            total += _fault(texels, other)
    return total


@kernel
def folded(texels: Texels) -> Bools:
    """Which texels are, [T]."""
    result = np.zeros(len(texels.positions), np.bool_)
    for flat in range(len(result)):
        result[flat] = _fault(texels, flat) >= 1.0
    return result
