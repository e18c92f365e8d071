"""The symmetric nine-point stencil of a texel mesh: stiffness weights and lumped areas, assembled cell by cell.

Vertices are the texel centres. Cells are the quads between four texels, also across glued sides, a triangle in each
corner of three charts, and a polygon in corners of five and more. Only real-space coordinates enter. Between the last
texels and a rim lies a strip of half a texel: its heights are those of the texels beside it, the natural boundary.

Layout. A stencil's weights are [C, 4, n + 1, n + 1]: those of the links of place (r, c) of a chart with halo to the
east (r, c)-(r, c + 1), north (r, c)-(r + 1, c), north-east (r, c)-(r + 1, c + 1), and its other diagonal
(r, c + 1)-(r + 1, c). A link that crosses a glued side stands on both charts, with the same value to the last bit.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Bools, Floats, Ints, kernel

from .cells import polygon, quad, triangle
from .irregular import IrregularLinks, gather_links
from .links import CrossingLinks, mean_of_copies
from .topology import TRIANGLE, TexelTopology


@dataclasses.dataclass(frozen=True, eq=False)
class Stencil:
    """Link weights w of a symmetric operator: the sum over links of w (h_j - h_i) is its value at texel i.

    Attributes
    ----------
    topology : TexelTopology
    weights : float64 [C, 4, n + 1, n + 1]
        Of the nine-point stencil, see the module.
    irregular : IrregularLinks or None
        What the nine-point stencil does not hold.
    """

    topology: TexelTopology
    weights: NDArray[np.float64]
    irregular: IrregularLinks | None = None

    def __call__(self, field: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sum over the links of w (h_j - h_i) at every texel of a field, float64 [C, n, n]."""
        result = np.empty(self.topology.shape)
        _gather(self.weights, self.topology.with_halo(field), result)
        if self.irregular is not None:
            gather_links(self.irregular, field.reshape(-1), result.reshape(-1))
        return result

    def absolute_sums(self) -> NDArray[np.float64]:
        """Sum of |w| over the links that meet in each texel, [C, n, n]."""
        sums = np.empty(self.topology.shape)
        _sum_absolute(self.weights, sums)
        if self.irregular is not None:
            sums.reshape(-1)[self.irregular.texels] += np.add.reduceat(
                np.abs(self.irregular.weights), self.irregular.begins[:-1]
            )
        return sums


class _Cells(NamedTuple):
    """What the assembly reads, each with halo: positions, coefficients, softening, halo table, rims, corners."""

    positions: Floats
    coefficient: Floats
    softening: Floats
    halo: Ints
    rim: Bools
    valence: Ints


def lumped_areas(topology: TexelTopology, halo_positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Area of the texel mesh that belongs to each texel [m^2], [C, n, n]; for the positions see `TexelMesh`."""
    return _assembled(topology, halo_positions, None, None)[1]


def stiffness_stencil(
    topology: TexelTopology,
    halo_positions: NDArray[np.float64],
    coefficient: NDArray[np.float64],
    softening: NDArray[np.float64] | None = None,
) -> Stencil:
    """Stiffness weights of -div(coefficient grad).

    Parameters
    ----------
    topology : TexelTopology
    halo_positions : [C, n + 2, n + 2, 3]
        Texel positions with halo [m], see `TexelMesh`.
    coefficient : [C, n, n]
        Averaged harmonically over the corners of every cell, as media in series: the operator stays symmetric, and a
        region where it is 0 is cut off at its edge.
    softening : [C, n, n], optional
        Factors up to 1: the stiffness of every cell is multiplied by the least of those at its corners.

    Returns
    -------
    Stencil
        Its value at a texel is the area integral of div(coefficient grad h).
    """
    weights = _assembled(topology, halo_positions, coefficient, softening)[0]
    weights = mean_of_copies(topology, weights)
    if not topology.polygons:
        return Stencil(topology, weights)
    soft = np.ones(topology.shape) if softening is None else softening
    return _with_polygons(topology, halo_positions, coefficient.reshape(-1), soft.reshape(-1), weights)


def _assembled(
    topology: TexelTopology,
    halo_positions: NDArray[np.float64],
    coefficient: NDArray[np.float64] | None,
    softening: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights [C, 4, n + 1, n + 1], each copy of a link with what its own chart sees, and areas [C, n, n]."""
    charts, n, _ = topology.shape
    weights, areas = np.zeros((charts, 4, n + 1, n + 1)), np.zeros((charts, n, n))
    ones = np.ones(topology.halo.shape)
    k, s = (ones if field is None else topology.with_halo(field) for field in (coefficient, softening))
    _assemble(_Cells(halo_positions, k, s, topology.halo, topology.rim, topology.valence), weights, areas)
    if topology.polygons:
        points = _texel_positions(halo_positions)
        for texels in topology.polygons:
            areas.reshape(-1)[texels] += polygon(points[texels])[1]
    return weights, areas


def _texel_positions(halo_positions: NDArray[np.float64]) -> NDArray[np.float64]:
    return halo_positions[:, 1:-1, 1:-1].reshape(-1, 3)


def _with_polygons(
    topology: TexelTopology,
    halo_positions: NDArray[np.float64],
    coefficient: NDArray[np.float64],
    softening: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> Stencil:
    """Add the polygons' links: their sides to the stencil, their diagonals beside it."""
    points, crossing = _texel_positions(halo_positions), CrossingLinks.of(topology)
    ends, values = [], []
    for texels in topology.polygons:
        k = coefficient[texels]
        conductance = len(k) / (1 / k).sum() if k.all() else 0.0
        first, second = np.triu_indices(len(texels), 1)
        links = conductance * softening[texels].min() * polygon(points[texels])[0][first, second]
        pairs = np.stack([texels[first], texels[second]], axis=1)
        beside = crossing.add(weights, pairs, links)
        ends.append(pairs[beside])
        values.append(links[beside])
    return Stencil(topology, weights, IrregularLinks.of(np.concatenate(ends), np.concatenate(values)))


@kernel
def _assemble(cells: _Cells, weights: Floats, areas: Floats) -> None:
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
                        _add_strip(x, k, s, rim, halo, r, c, (link, area))
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
    x: Floats, k: Floats, s: Floats, rim: Bools, halo: Ints, r: int, c: int, sums: tuple[Floats, Floats]
) -> None:
    """A cell at a rim: each of its corners beyond the rim moves as the texel beside it.

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
        a, b = min(moves[i], moves[j]), max(moves[i], moves[j])
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


# link, the place from which it starts relative to the texel, and its other end
_SIDES = ((0, 0, 0, 0, 1), (0, 0, -1, 0, -1), (1, 0, 0, 1, 0), (1, -1, 0, -1, 0))
_DIAGONALS = ((2, 0, 0, 1, 1), (2, -1, -1, -1, -1), (3, -1, 0, -1, 1), (3, 0, -1, 1, -1))


@kernel
def _gather(w: Floats, h: Floats, out: Floats) -> None:
    """Sum of weight (h_j - h_i) over the stencil; h has a halo."""
    n = out.shape[1]
    for f in range(len(out)):
        for r in range(1, n + 1):
            for c in range(1, n + 1):
                total = 0.0
                for links in (_SIDES, _DIAGONALS):
                    for link, i, j, dr, dc in links:
                        total += w[f, link, r + i, c + j] * (h[f, r + dr, c + dc] - h[f, r, c])
                out[f, r - 1, c - 1] = total


@kernel
def _sum_absolute(w: Floats, out: Floats) -> None:
    n = out.shape[1]
    for f in range(len(out)):
        for r in range(1, n + 1):
            for c in range(1, n + 1):
                total = 0.0
                for links in (_SIDES, _DIAGONALS):
                    for link, i, j, _, _ in links:
                        total += abs(w[f, link, r + i, c + j])
                out[f, r - 1, c - 1] = total
