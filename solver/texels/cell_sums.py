"""The cells of a texel mesh, added up chart by chart: link weights and areas, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel

from .cells import quad, triangle
from .topology import TRIANGLE


class Cells(NamedTuple):
    """What the assembly reads, each with halo: positions, coefficients, softening, halo table, rims, corners."""

    positions: Floats
    coefficient: Floats
    softening: Floats
    halo: Ints
    rim: Bools
    valence: Ints
    fixed_rim: bool


@kernel
def assemble(cells: Cells, weights: Floats, areas: Floats) -> None:
    """Add up the cells of each chart with halo: weights [C, 4, n + 1, n + 1], areas [C, n, n]."""
    n = areas.shape[1]
    # one place wider than the stencil: links inside the halo are collected too and left behind
    link = np.zeros((4, n + 2, n + 2))
    area = np.zeros((n + 2, n + 2))
    for chart in range(len(areas)):
        link[:] = 0
        area[:] = 0
        x, k, s = cells.positions[chart], cells.coefficient[chart], cells.softening[chart]
        halo, rim = cells.halo[chart], cells.rim[chart]
        for r in range(n + 1):
            for c in range(n + 1):
                if halo[r, c] >= 0 and halo[r, c + 1] >= 0 and halo[r + 1, c] >= 0 and halo[r + 1, c + 1] >= 0:
                    if rim[r, c] or rim[r, c + 1] or rim[r + 1, c] or rim[r + 1, c + 1]:
                        _add_strip(x, k, s, rim, halo, r, c, (link, area), cells.fixed_rim)
                    else:
                        _add_quad(x, k, s, r, c, link, area)
                elif cells.valence[chart, _corner(r, c)] == TRIANGLE:
                    _add_triangle(x, k, s, r, c, link, area)
        weights[chart] = link[:, : n + 1, : n + 1]
        areas[chart] = area[1 : n + 1, 1 : n + 1]


@kernel(inline="always")
def _corner(r: int, c: int) -> int:
    """Number of the corner of a chart in which a cell lies."""
    if r == 0:
        return 0 if c == 0 else 1
    return 3 if c == 0 else 2


@kernel
def _conductance(k: Floats, s: Floats, r: int, c: int) -> float:
    """Harmonic mean of the coefficients at the corners of a cell, softened by the least factor."""
    a, b, d, e = k[r, c], k[r, c + 1], k[r + 1, c], k[r + 1, c + 1]
    conductance = 4 / (1 / a + 1 / b + 1 / d + 1 / e) if a * b * d * e > 0 else 0.0
    return conductance * min(s[r, c], s[r, c + 1], s[r + 1, c], s[r + 1, c + 1])


@kernel
def _add_quad(x: Floats, k: Floats, s: Floats, r: int, c: int, link: Floats, area: Floats) -> None:
    """The quad between the texels (r, c) and (r + 1, c + 1): link weights [4, n + 2, n + 2], areas [n + 2, n + 2]."""
    south_north, west_east, rising, falling, whole = quad(x[r, c], x[r, c + 1], x[r + 1, c], x[r + 1, c + 1])
    conductance = _conductance(k, s, r, c)
    link[0, r, c] += conductance * south_north
    link[0, r + 1, c] += conductance * south_north
    link[1, r, c] += conductance * west_east
    link[1, r, c + 1] += conductance * west_east
    link[2, r, c] += conductance * rising
    link[3, r, c] += conductance * falling
    for i in range(2):
        for j in range(2):
            area[r + i, c + j] += whole / 4


@kernel
def _add_triangle(x: Floats, k: Floats, s: Floats, r: int, c: int, link: Floats, area: Floats) -> None:
    """The cell in a corner of three charts: the halo's corner does not exist; a triangle of the other three."""
    # the chart's own texel is at r0, c0
    r0, r1 = (1, 0) if r == 0 else (r, r + 1)
    c0, c1 = (1, 0) if c == 0 else (c, c + 1)
    _, vertical, horizontal, whole = triangle(x[r0, c0], x[r0, c1], x[r1, c0])
    a, b, d = k[r0, c0], k[r0, c1], k[r1, c0]
    conductance = 3 / (1 / a + 1 / b + 1 / d) if a * b * d > 0 else 0.0
    conductance *= min(s[r0, c0], s[r0, c1], s[r1, c0])
    area[r0, c0] += whole / 3
    link[1, r, c0] += conductance * vertical
    link[0, r0, c] += conductance * horizontal


@kernel
def _add_strip(
    x: Floats, k: Floats, s: Floats, rim: Bools, halo: Ints, r: int, c: int, sums: tuple[Floats, Floats], fixed: bool
) -> None:
    """A cell at a rim: each of its corners beyond the rim moves as the texel beside it, or is fixed.

    Nothing is known of a strip where the rim has no positions.
    """
    link, area = sums
    south_north, west_east, rising, falling, whole = quad(x[r, c], x[r, c + 1], x[r + 1, c], x[r + 1, c + 1])
    if not np.isfinite(whole):
        return
    conductance = _conductance(k, s, r, c)
    # corners are numbered 0 to 3 by row and column; `moves` is the texel of the cell with which each of them moves
    moves = np.empty(4, np.int64)
    for i in range(4):
        moves[i] = i
        for j in range(4):
            own = not rim[r + j // 2, c + j % 2]
            if rim[r + i // 2, c + i % 2] and own and halo[r + j // 2, c + j % 2] == halo[r + i // 2, c + i % 2]:
                moves[i] = j
        area[r + moves[i] // 2, c + moves[i] % 2] += whole / 4
    for i, j, weight in (
        (0, 1, south_north), (2, 3, south_north), (0, 2, west_east), (1, 3, west_east), (0, 3, rising), (1, 2, falling)
    ):  # fmt: skip
        a, b = (i, j) if fixed else (min(moves[i], moves[j]), max(moves[i], moves[j]))
        if a == b:
            continue
        if b - a == 2:
            link[1, r, c + a] += conductance * weight
        elif b - a == 3:
            link[2, r, c] += conductance * weight
        elif a == 1:
            link[3, r, c] += conductance * weight
        else:
            link[0, r + a // 2, c] += conductance * weight
