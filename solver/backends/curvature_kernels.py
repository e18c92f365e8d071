"""Compiled loops for the bending of a plate with rims, by the squares of three curvatures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import Floats32, Ints, kernel
from .stencil_kernels import NO_FLOATS, NO_INTS

# Texels whose curvatures are computed together: with their weights they stay in the fastest memory.
BLOCK = 512


class Squares(NamedTuple):
    """Bending by the squares of three curvatures; see `Curvatures`."""

    weights: Floats32  # of the eight neighbours in each curvature, as coefficients, [8, 3, size]
    steps: Ints  # from an address to the address of each neighbour, [8]
    rows: int  # rows of texels in all charts
    chart_rows: int  # rows of texels in one chart
    columns: int  # columns of texels
    pitch: int  # addresses from one row to the next
    force: Floats32  # a field for the forces; empty without curvatures
    scratch: Floats32  # room for a block of texels, [4, BLOCK]


NO_SQUARES = Squares(
    weights=np.zeros((0, 0, 0), np.float32),
    steps=NO_INTS,
    rows=0,
    chart_rows=1,
    columns=0,
    pitch=0,
    force=NO_FLOATS,
    scratch=np.zeros((4, 0), np.float32),
)


@kernel(no_cpython_wrapper=True)
def bend(squares: Squares, h: Floats32, halo: Ints, add: bool, out: Floats32) -> None:
    """Write the force of the curvatures at each texel into `out`, or add it.

    Every curvature pulls at the texels from which it was computed, also at places of the halo. A
    force on a place of the halo is then handed to the texel that the place shows.
    """
    columns = squares.columns
    force = squares.force
    force[:] = np.float32(0)
    for i in range(squares.rows):
        at = _first_of_row(squares, i)
        for begin in range(0, columns, BLOCK):
            count = min(BLOCK, columns - begin)
            _pull_neighbours(squares, i * columns + begin, at + begin, count, h, force)
    for i in range(halo.shape[1]):
        force[halo[1, i]] += force[halo[0, i]]
    for i in range(squares.rows):
        at = _first_of_row(squares, i)
        pull = force[at : at + columns]
        result = out[at : at + columns]
        for c in range(columns):
            result[c] = result[c] + pull[c] if add else pull[c]


@kernel(no_cpython_wrapper=True)
def _first_of_row(squares: Squares, i: int) -> int:
    """Address of the first texel of row i, of all charts."""
    chart = i // squares.chart_rows
    row = i % squares.chart_rows
    return (chart * (squares.chart_rows + 2) + row + 1) * squares.pitch + 1


@kernel(no_cpython_wrapper=True)
def _pull_neighbours(
    squares: Squares, first: int, at: int, count: int, h: Floats32, force: Floats32
) -> None:
    """Add the forces of the curvatures of texels that lie side by side.

    Their coefficients begin at `first`, and the texels at the address `at`.
    """
    own = squares.scratch[0]
    uu = squares.scratch[1]
    vv = squares.scratch[2]
    uv = squares.scratch[3]
    row = h[at : at + count]
    for c in range(count):
        own[c] = uu[c] = vv[c] = uv[c] = np.float32(0)
    for k in range(len(squares.steps)):
        start = at + squares.steps[k]
        beside = h[start : start + count]
        weights = squares.weights[k]
        to_uu = weights[0, first : first + count]
        to_vv = weights[1, first : first + count]
        to_uv = weights[2, first : first + count]
        for c in range(count):
            difference = beside[c] - row[c]
            uu[c] += to_uu[c] * difference
            vv[c] += to_vv[c] * difference
            uv[c] += to_uv[c] * difference
    for k in range(len(squares.steps)):
        start = at + squares.steps[k]
        pulled = force[start : start + count]
        weights = squares.weights[k]
        to_uu = weights[0, first : first + count]
        to_vv = weights[1, first : first + count]
        to_uv = weights[2, first : first + count]
        for c in range(count):
            pull = to_uu[c] * uu[c] + to_vv[c] * vv[c] + to_uv[c] * uv[c]
            pulled[c] -= pull
            own[c] += pull
    pulled = force[at : at + count]
    for c in range(count):
        pulled[c] += own[c]
