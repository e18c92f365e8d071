"""Stiffness weights and lumped areas of a texel mesh, at rest or wherever its texels have moved.

Vertices are the texel centres. Cells are the quads between four texels, also across glued sides,
strips at rims, and a triangle or a polygon in corners of other than four charts. Only real-space
coordinates enter. What stays while texels move is worked out once. The few special cells are
NumPy's. So are the quads at rest, in double precision, which a compiled loop would take longer to
compile than to work out on most meshes; those of a surface that moves are wanted anew in every
step, and have a compiled loop in single precision.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import NamedTuple, TypeAlias

import numpy as np

from ..kernel import Floats, Floats32, Ints, kernel
from .cells import LINKS, at_corners, conductance, quad, quad_area, special_cells
from .stencil import IrregularLinks, Stencil, crossing_links, missing_links
from .topology import TexelTopology

# Area of a cell over that at rest, at least: no density grows beyond a thousand times that at rest.
LEAST_RATIO = np.float32(1e-3)

_BLOCK = 2**13  # cells at rest that are worked out at once: they stay in the processor's cache
_BAND = 1024  # places of moving texels, in whole rows: they stay in the fastest memory

# Places from one row of what they give to the next, at least the width of a chart. As a constant it
# spares the compiler most of the pairs of arrays of which it would have to check that they lie
# apart: with more it makes no wide loop.
_ROW = 2**14 + 16

_ONE = np.float32(1)
_QUARTER = np.float32(0.25)
_ZERO = np.float32(0)


class QuadCells(NamedTuple):
    """What does not change while the quads move.

    Attributes
    ----------
    conductance : float32 [C, n + 2, n + 2]
        Coefficient at rest of the quad whose south-west corner is at each place, 0 where there is
        none.
    per_area : float32 [C, n + 2, n + 2]
        One over its area at rest, in units of 1 / scale^2.
    scale : float
        One over about the length of a quad at rest [1/m]: all that is computed is then about 1.
    power : float
        With which the coefficient goes with the area.
    detours : float32 [4, C, n + 2, n + 2]
        See `link_detours`.
    """

    conductance: Floats32
    per_area: Floats32
    scale: float
    power: float
    detours: Floats32


# A coefficient at rest: of the quads, and of the special cells, kind by kind, each [k]
CellCoefficient: TypeAlias = tuple[QuadCells, tuple[Floats, ...]]


class TexelCells:
    """The cells of a texel mesh, added up to stencils and areas.

    A coefficient of a surface that moves goes with a power of each cell's area over that at rest:
    with -1 what is spread over the surface, such as its density, gets thinner as that stretches.

    `halo_positions` [C, n + 2, n + 2, 3] [m] are those of the texels at rest, and `detours` [4, C,
    n + 2, n + 2] how much longer than straight the links of quads are, by the same share wherever
    the texels move; see `TexelMesh`.
    """

    def __init__(
        self, topology: TexelTopology, halo_positions: Floats, detours: Floats32 | None = None
    ) -> None:
        self.topology = topology
        self._positions = halo_positions
        self._detours = (
            np.zeros((4, *topology.halo.shape), np.float32) if detours is None else detours
        )
        charts, n, _ = topology.shape
        self._shape = (charts, 4, n + 1, n + 1)
        self._special = special_cells(topology, halo_positions)
        self._whole = np.logical_and.reduce(at_corners((topology.halo >= 0) & ~topology.rim))
        extent = float(np.ptp(halo_positions[:, 1:-1, 1:-1], axis=(0, 1, 2)).max())
        self._scale = (
            float(np.float32(np.sqrt(topology.texel_count) / extent)) if extent > 0 else 1.0
        )
        ends = np.concatenate(
            [np.zeros((0, 2), np.int64), *(each.irregular[1] for each in self._special)]
        )
        self._links = IrregularLinks.of(ends, np.arange(len(ends), dtype=np.float64))

    @functools.cached_property
    def areas(self) -> Floats:
        """Area of the mesh of texel centres that belongs to each texel at rest [m^2], [C, n, n]."""
        around = np.zeros(self._positions.shape[:3])
        quarters = self._quad_areas() / (4 * self._scale**2)
        for corner in at_corners(around)[::-1]:
            corner += quarters
        areas = np.ascontiguousarray(around[:, 1:-1, 1:-1])
        for cells in self._special:
            shares = cells.weigh(self._positions.reshape(-1, 3).T, self._scale)[1]
            np.add.at(areas.reshape(-1), cells.shares[1], shares.ravel()[cells.shares[0]])
        return areas

    def at_rest(self, values: Floats, softening: Floats) -> Stencil:
        """Stencil of values [C, n, n], see `TexelMesh.stencil`."""
        weights = np.zeros(self._shape)
        fields = [self.topology.with_halo(each) for each in (values, softening)]
        for charts, rows, part, ways in self._blocks():
            above = slice(rows.start + 1, rows.stop + 1)
            factor = conductance(*(at_corners(each[part]) for each in fields))
            detours = [
                at_corners(self._detours[link, *part])[2 * down + right]
                for link, down, right in LINKS
            ]
            with np.errstate(invalid="ignore"):  # beyond rims there may be no positions
                quads = quad(*ways, detours)
                links = np.where(self._whole[charts, rows], np.stack(quads[:6]), 0.0)
            south, north, west, east, rising, falling = factor * links
            link = weights[charts]
            link[:, 0, above] += north[:, : len(link[0, 0, above])]
            link[:, 0, rows] += south
            link[:, 1, rows, 1:] += east[:, :, :-1]
            link[:, 1, rows] += west
            link[:, 2, rows] = rising
            link[:, 3, rows] = falling
        places = self._positions.reshape(-1, 3).T
        factors = self._special_coefficient(*fields)
        return Stencil(
            self.topology, weights, self._add_special(places, factors, 0.0, weights, None)
        )

    def coefficient(self, values: Floats, softening: Floats, power: float) -> CellCoefficient:
        """Coefficient of a surface that moves, of values at the texels at rest [C, n, n]; see `TexelMesh.stencil`."""
        fields = [self.topology.with_halo(each) for each in (values, softening)]
        quads = np.where(
            self._per_area > 0, _with_zeros(conductance(*map(at_corners, fields))), _ZERO
        )
        return QuadCells(
            quads, self._per_area, self._scale, power, self._detours
        ), self._special_coefficient(*fields)

    def moved(self, around: Floats, coefficient: CellCoefficient) -> tuple[Stencil, Floats]:
        """Stencil of texels that have moved, and the area that belongs to each [m^2], [C, n, n].

        `around` [3, C, n + 2, n + 2] are the coordinates of the texels with halo [m].
        """
        weights = np.empty(self._shape)
        areas = np.empty(self.topology.shape)
        quads, special = coefficient
        quad_pass(around, quads, weights, areas)
        links = self._add_special(around.reshape(3, -1), special, quads.power, weights, areas)
        return Stencil(self.topology, weights, links), areas

    def special(
        self, around: Floats, coefficient: CellCoefficient
    ) -> tuple[Floats, IrregularLinks]:
        """What all cells but the quads give to the links at `special_links`, and the irregular links.

        Only the places at `special_places` of those around are looked at.
        """
        weights = self._empty
        (quads, special) = coefficient
        links = self._add_special(around.reshape(3, -1), special, quads.power, weights, None)
        values = weights.reshape(-1)[self.special_links]
        weights.reshape(-1)[self.special_links] = 0.0
        return values, links

    @functools.cached_property
    def special_places(self) -> Ints:
        """Flat places, of a field with halo, of the corners of all cells but the quads."""
        return np.unique(
            np.concatenate(
                [np.zeros(0, np.int64), *(each.corners.ravel() for each in self._special)]
            )
        )

    @functools.cached_property
    def special_links(self) -> Ints:
        """Flat places, among a stencil's weights, of the links to which other cells than quads add, with all copies."""
        touched = np.zeros(self._shape)
        crossing = crossing_links(self.topology)
        for cells in self._special:
            touched.reshape(-1)[cells.links[1]] = 1.0
        crossing.level(touched)
        return np.flatnonzero(touched)

    @functools.cached_property
    def _empty(self) -> Floats:
        return np.zeros(self._shape)

    @functools.cached_property
    def _per_area(self) -> Floats32:
        """One over the areas of whole quads at rest, see `QuadCells`; 0 where there is none."""
        areas = self._quad_areas()
        return _with_zeros(np.divide(1, areas, out=np.zeros_like(areas), where=areas > 0))

    def _quad_areas(self) -> Floats:
        """Areas of whole quads at rest in units of 1 / scale^2, [C, n + 1, n + 1]; 0 where there is none."""
        areas = np.empty(self._whole.shape)
        for charts, rows, _, ways in self._blocks():
            with np.errstate(invalid="ignore"):  # beyond rims there may be no positions
                quads = quad_area(*ways)
            areas[charts, rows] = np.where(self._whole[charts, rows], quads, 0.0)
        return areas

    @functools.cached_property
    def _special_per_area(self) -> list[Floats]:
        """One over the areas of the special cells at rest [1/m^2], kind by kind; 1 for those without."""
        areas = [
            each.weigh(self._positions.reshape(-1, 3).T, self._scale)[2] for each in self._special
        ]
        return [1 / np.where(each > 0, each, 1.0) for each in areas]

    def _special_coefficient(self, values: Floats, softening: Floats) -> tuple[Floats, ...]:
        """Coefficient of the special cells, kind by kind, from fields with halo."""
        return tuple(
            conductance(*(list(field.reshape(-1)[each.corners]) for field in (values, softening)))
            for each in self._special
        )

    def _add_special(
        self,
        places: Floats,
        factors: tuple[Floats, ...],
        power: float,
        weights: Floats,
        areas: Floats | None,
    ) -> IrregularLinks:
        """Add the special cells to weights and areas, and make the copies of each link agree; the irregular links."""
        flat = weights.reshape(-1)
        irregular = [np.zeros(0)]
        of_polygons = []
        for kind, (cells, factor) in enumerate(zip(self._special, factors, strict=True)):
            links, shares, area = cells.weigh(places, self._scale)
            if power:
                factor = (
                    factor * np.maximum(area * self._special_per_area[kind], LEAST_RATIO) ** power
                )
            values = (factor * links).ravel()
            if areas is not None:
                np.add.at(areas.reshape(-1), cells.shares[1], shares.ravel()[cells.shares[0]])
            irregular.append(values[cells.irregular[0]])
            if cells.on_all_copies:
                of_polygons.append((cells.links[1], values[cells.links[0]]))
            else:
                np.add.at(flat, cells.links[1], values[cells.links[0]])
        flat[missing_links(self.topology)] = 0.0
        crossing_links(self.topology).level(weights)
        for link_places, values in of_polygons:
            np.add.at(flat, link_places, values)
        return self._links._replace(
            weights=np.concatenate(irregular)[self._links.weights.astype(np.int64)]
        )

    def _blocks(self) -> Iterator[tuple[slice, slice, tuple[slice, slice], list[Floats]]]:
        """Charts, rows of cells, both with the row of texels above, and the ways, scaled, that make a `quad`."""
        charts, _, size, _ = self._shape
        together = max(1, _BLOCK // size**2)
        high = max(1, _BLOCK // size)
        for chart in range(0, charts, together):
            for row in range(0, size, high):
                rows = slice(row, min(row + high, size))
                part = slice(chart, min(chart + together, charts)), slice(row, rows.stop + 1)
                x = at_corners(self._scale * np.moveaxis(self._positions[part], -1, 0))
                yield part[0], rows, part, [each - x[0] for each in x[1:]]


def _with_zeros(quads: Floats) -> Floats32:
    """Values of quads [C, n + 1, n + 1] at their south-west corners among the places of a field with halo."""
    return np.pad(quads, ((0, 0), (0, 1), (0, 1))).astype(np.float32)


_quad = kernel(inline="always")(quad)  # a loop over it is wide only if it is all in one piece


@kernel
def quad_pass(around: Floats, cells: QuadCells, weights: Floats, areas: Floats) -> None:
    """Fill in what the quads give to the weights [C, 4, n + 1, n + 1] and the texels' areas [m^2], [C, n, n].

    Coordinates are [3, C, n + 2, n + 2], with halo. Rows and charts follow one another in memory,
    so that a band is one loop over places; those at the end of a row are no quads.
    """
    charts, width = cells.conductance.shape[:2]
    rows = max(_BAND // width, 1)
    places = around.reshape(3, -1)
    sides = np.zeros((7, _ROW), np.float32)
    below = np.zeros((2, width - 1), np.float32)
    # not one of the sides: loops over both would not be wide
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
    """Geometric weights of the six links of the quads of consecutive places, and their areas times scale squared.

    Differences are taken in double precision, so that a surface far from the origin loses nothing.
    """
    scale = cells.scale
    above = first + cells.conductance.shape[1]
    detours = cells.detours.reshape(4, -1)
    found = sides.reshape(-1)
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
        found[c] = south
        found[c + _ROW] = north
        found[c + 2 * _ROW] = west
        found[c + 3 * _ROW] = east
        found[c + 4 * _ROW] = rising
        found[c + 5 * _ROW] = falling
        found[c + 6 * _ROW] = area


@kernel(no_cpython_wrapper=True)
def _scale(sides: Floats32, cells: QuadCells, first: int, count: int, factor: Floats32) -> None:
    """Multiply the weights of a band by what the coefficient has become; leave a quarter of the areas.

    Both are cleared where there is no quad.
    """
    conductance = cells.conductance.reshape(-1)[first:]
    per_area = cells.per_area.reshape(-1)[first:]
    area = sides[6]
    power = np.float32(cells.power)
    for c in range(count):
        ratio = max(area[c] * per_area[c], LEAST_RATIO)
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
    """Give a chart's row of weights and areas to links and texels; `below` has north sides and areas of the last.

    Areas are in units of 1 / unit.
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
