"""Stiffness weights and lumped areas of a texel mesh.

Vertices are the texel centres. Cells are the quads between four texels, also across glued sides, a triangle in each
corner of three charts, and a polygon in corners of five and more. Only real-space coordinates enter. Between the last
texels and a rim lies a strip of half a texel: where the rim is free, heights in it change along the rim only.

The cells of a texel mesh, added up: link weights and areas.

Plain numpy, block by block: it runs a few times, and a compiled loop takes longer to compile than this takes on most
meshes. Every place collects its cells row by row, so that the sums do not depend on the blocks.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .cells import polygon, quad, strip, triangle
from .stencil import CrossingLinks, IrregularLinks, Stencil, mean_of_copies
from .topology import TRIANGLE, TexelTopology

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]
Place: TypeAlias = tuple[NDArray[np.integer], ...]  # chart, row, column of some cells of a block

_BLOCK = 2**13  # cells; what is computed of them stays in the processor's cache

# The four corners of a cell and its six links: what the cell at (r, c) adds to at (r + dr, c + dc). In this order a
# place collects its cells row by row.
_CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
_COLLECTED = (3, 2, 1, 0)
_NORTH, _SOUTH, _EAST, _WEST, _RISING, _FALLING = range(6)
_LINKS = ((0, 1, 0), (0, 0, 0), (1, 0, 1), (1, 0, 0), (2, 0, 0), (3, 0, 0))  # link, dr, dc
_BETWEEN = {(0, 1): _SOUTH, (2, 3): _NORTH, (0, 2): _WEST, (1, 3): _EAST}


class Cells(NamedTuple):
    """What the assembly reads, each with halo: positions, coefficients, softening, halo table, rims, corners."""

    positions: Floats
    coefficient: Floats
    softening: Floats
    halo: Ints
    rim: Bools
    valence: Ints
    fixed_rim: bool


class _Sums(NamedTuple):
    """What the cells of a block, [k, b, n + 1], add to links and corners: quads everywhere, other cells in places."""

    links: list[Floats]
    corner: Floats
    other_links: list[tuple[int, Place, Floats]]
    other_corners: list[tuple[int, Place, Floats]]


def assemble(cells: Cells, weights: Floats, areas: Floats) -> None:
    """Add up the cells of each chart with halo: weights [C, 4, n + 1, n + 1], areas [C, n, n], both 0 before."""
    around = np.zeros(cells.halo.shape)
    with np.errstate(divide="ignore", invalid="ignore"):  # beyond rims there may be no positions
        for charts, rows in _blocks(len(areas), weights.shape[-1]):
            sums = _add_up(cells, charts, rows)
            for kind, (link, dr, dc) in enumerate(_LINKS):
                target = weights[charts, link, rows.start + dr : rows.stop + dr, dc:]
                _collect(target, sums.links[kind], [each for each in sums.other_links if each[0] == kind])
            for corner in _COLLECTED:
                dr, dc = _CORNERS[corner]
                target = around[charts, rows.start + dr : rows.stop + dr, dc : dc + weights.shape[-1]]
                _collect(target, sums.corner, [each for each in sums.other_corners if each[0] == corner])
    areas[:] = around[:, 1:-1, 1:-1]


def _blocks(charts: int, size: int) -> Iterator[tuple[slice, slice]]:
    """Charts, and rows of the cells in them, `size` x `size`."""
    together, high = max(1, _BLOCK // size**2), max(1, _BLOCK // size)
    for chart in range(0, charts, together):
        for row in range(0, size, high):
            yield slice(chart, min(chart + together, charts)), slice(row, min(row + high, size))


def _collect(target: Floats, everywhere: Floats, others: list[tuple[int, Place, Floats]]) -> None:
    """Add what cells hold for their places; links inside the halo, which have none, are left behind."""
    _, height, width = target.shape
    target += everywhere[:, :height, :width]
    for _, (chart, r, c), value in others:
        kept = (r < height) & (c < width)
        target[chart[kept], r[kept], c[kept]] += value[kept]


def _add_up(cells: Cells, charts: slice, rows: slice) -> _Sums:
    """What the cells of a block add to links and corners."""
    size = cells.halo.shape[-1] - 1

    def corners(field: NDArray) -> list[NDArray]:
        return [field[..., i : i + rows.stop - rows.start, j : j + size] for i, j in _CORNERS]

    part = charts, slice(rows.start, rows.stop + 1)
    x = corners(np.ascontiguousarray(np.moveaxis(cells.positions[part], -1, 0)))
    k, s, halo, rim = (corners(field[part]) for field in (cells.coefficient, cells.softening, cells.halo, cells.rim))
    exists = (np.minimum(np.minimum(halo[0], halo[1]), np.minimum(halo[2], halo[3]))) >= 0
    at_rim = rim[0] | rim[1] | rim[2] | rim[3]
    *sides, rising, falling, whole = quad(*x)
    conductance = conductances(k, s)
    inner = exists & ~at_rim
    south, north, west, east = sides
    weights = [conductance * weight for weight in (north, south, east, west, rising, falling)]
    sums = _Sums([np.where(inner, weight, 0.0) for weight in weights], np.where(inner, whole / 4, 0.0), [], [])
    strips = np.nonzero(exists & at_rim & np.isfinite(whole))
    if len(strips[0]):
        around = tuple(np.stack([field[strips] for field in corner], axis=1) for corner in (halo, rim))
        _share_strips(sums, strips, around, (whole / 4)[strips])
        if cells.fixed_rim:
            sums.other_links.extend((kind, strips, weight[strips]) for kind, weight in enumerate(weights))
        else:
            _link_strips(
                sums,
                strips,
                around[1],
                [np.stack([axis[strips] for axis in corner]) for corner in x],
                conductance[strips],
            )
    _add_triangles(sums, cells, charts, rows)
    return sums


def conductances(k: list[Floats], s: list[Floats]) -> Floats:
    """Harmonic mean of the coefficients at the corners of cells, 0 where one is, softened by the least factor."""
    product, resistance, softest = k[0], 1 / k[0], s[0]
    for other, factor in zip(k[1:], s[1:], strict=True):
        product, resistance, softest = product * other, resistance + 1 / other, np.minimum(softest, factor)
    return np.where(product > 0, len(k) / resistance, 0.0) * softest


def _add_triangles(sums: _Sums, cells: Cells, charts: slice, rows: slice) -> None:
    """The cells in corners of three charts: the halo's corner does not exist; triangles of the other three."""
    n = cells.halo.shape[-1] - 2
    for corner, (r, c) in enumerate(((0, 0), (0, n), (n, n), (n, 0))):
        chart = np.flatnonzero(cells.valence[charts, corner] == TRIANGLE)
        if not len(chart) or not rows.start <= r < rows.stop:
            continue
        # the chart's own texel is at r0, c0
        r0, r1 = (1, 0) if r == 0 else (r, r + 1)
        c0, c1 = (1, 0) if c == 0 else (c, c + 1)
        places = [(charts.start + chart, row, column) for row, column in ((r0, c0), (r0, c1), (r1, c0))]
        _, vertical, horizontal, whole = triangle(*(cells.positions[place].T for place in places))
        conductance = conductances([cells.coefficient[p] for p in places], [cells.softening[p] for p in places])
        place = chart, np.full_like(chart, r - rows.start), np.full_like(chart, c)
        sums.other_corners.append((_CORNERS.index((r0 - r, c0 - c)), place, whole / 3))
        sums.other_links.append((_EAST if c == 0 else _WEST, place, conductance * vertical))
        sums.other_links.append((_NORTH if r == 0 else _SOUTH, place, conductance * horizontal))


def _share_strips(sums: _Sums, strips: Place, around: tuple[NDArray, ...], share: Floats) -> None:
    """The areas of cells at a rim: each of their corners beyond the rim has its own go to the texel beside it.

    Nothing is known of a strip where the rim has no positions.

    Parameters
    ----------
    strips
        The cells, [k].
    around
        Halo table and rim at their corners, [k, 4].
    share
        Quarter of their area [m^2], [k].
    """
    halo, rim = around
    for i in range(4):
        belongs = np.full(len(share), i)
        for j in range(4):
            belongs[rim[:, i] & ~rim[:, j] & (halo[:, i] == halo[:, j])] = j
        for corner in range(4):
            here = belongs == corner
            sums.other_corners.append((corner, tuple(index[here] for index in strips), share[here]))


def _link_strips(sums: _Sums, strips: Place, rim: Bools, x: list[Floats], conductance: Floats) -> None:
    """The links between two texels beside a free rim, for the cells from them to that; rim [k, 4], corners [3, k]."""
    for (i, j), kind in _BETWEEN.items():
        p, q = 3 - j, 3 - i  # opposite
        here = ~rim[:, i] & ~rim[:, j] & rim[:, p] & rim[:, q]
        weight = strip(*(x[corner][:, here] for corner in (i, j, p, q)))
        sums.other_links.append((kind, tuple(index[here] for index in strips), conductance[here] * weight))


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
    assemble(
        Cells(halo_positions, k, s, topology.halo, topology.rim, topology.valence, topology.fixed_rim), weights, areas
    )
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
