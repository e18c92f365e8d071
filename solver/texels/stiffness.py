"""Stiffness weights and lumped areas of a texel mesh, at rest or wherever its texels have moved.

Vertices are the texel centres. Cells are the quads between four texels, also across glued sides,
strips at rims, and a triangle or a polygon in corners of other than four charts. Only real-space
coordinates enter. Whatever stays while texels move is worked out once. NumPy works out the few
special cells. It also works out the quads at rest, in double precision: a compiled loop would take
longer to compile than to run on most meshes. The quads of a surface that moves are needed anew in
every step, and have a compiled loop in single precision, `quad_pass`.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

from ..kernel import Floats, Floats32, Ints
from .cells import conductance, quad, quad_area
from .quad_pass import MIN_AREA_RATIO, QuadCells, quad_pass
from .special_cells import LINKS, at_corners, special_cells
from .stencil import IrregularLinks, Stencil, crossing_links, missing_links
from .topology import TexelTopology

# Cells at rest that are worked out at once: they stay in the processor's cache.
_CELLS_IN_BLOCK = 2**13

# 0 in single precision, so that an array of single numbers stays one.
_ZERO = np.float32(0)

# A coefficient at rest: of the quads, and of the special cells, kind by kind, each [k].
CellCoefficient: TypeAlias = tuple[QuadCells, tuple[Floats, ...]]


class TexelCells:
    """The cells of a texel mesh, added up to stencils and areas.

    A coefficient of a surface that moves goes with a power of each cell's area over its area at
    rest. With the power -1 a quantity that is spread over the surface, such as its density, gets
    thinner as the surface stretches.

    Parameters
    ----------
    topology : TexelTopology
    halo_positions : float64 [C, n + 2, n + 2, 3]
        Positions of the texels at rest, with halo [m].
    detours : float32 [4, C, n + 2, n + 2], optional
        How much longer than straight the links of quads are, by the same share wherever the texels
        move; see `TexelMesh`.
    """

    def __init__(
        self, topology: TexelTopology, halo_positions: Floats, detours: Floats32 | None = None
    ) -> None:
        self.topology = topology
        self._positions = halo_positions
        if detours is None:
            detours = np.zeros((4, *topology.halo.shape), np.float32)
        self._detours = detours
        charts, n, _ = topology.shape
        self._shape = (charts, 4, n + 1, n + 1)
        self._special = special_cells(topology, halo_positions)
        has_texel = (topology.halo >= 0) & ~topology.rim
        self._whole = np.logical_and.reduce(at_corners(has_texel))
        self._whole &= ~topology.still[:, None, None]
        extent = float(np.ptp(halo_positions[:, 1:-1, 1:-1], axis=(0, 1, 2)).max())
        self._scale = 1.0
        if extent > 0:
            self._scale = float(np.float32(np.sqrt(topology.texel_count) / extent))
        # irregular links whose weights are their numbers in the order of the special cells
        ends_by_kind = [np.zeros((0, 2), np.int64)]
        ends_by_kind += [cells.irregular[1] for cells in self._special]
        ends = np.concatenate(ends_by_kind)
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
        values = self.topology.with_halo(values)
        softening = self.topology.with_halo(softening)
        for charts, rows, texels, ways in self._blocks():
            above = slice(rows.start + 1, rows.stop + 1)
            factor = conductance(at_corners(values[texels]), at_corners(softening[texels]))
            detours = []
            for link, down, right in LINKS:
                corner = 2 * down + right
                detours.append(at_corners(self._detours[link, *texels])[corner])
            with np.errstate(invalid="ignore"):  # beyond rims there may be no positions
                quads = quad(*ways, detours)
                links = np.where(self._whole[charts, rows], np.stack(quads[:6]), 0.0)
            south, north, west, east, rising, falling = factor * links
            block_weights = weights[charts]
            rows_above = len(block_weights[0, 0, above])
            block_weights[:, 0, above] += north[:, :rows_above]
            block_weights[:, 0, rows] += south
            block_weights[:, 1, rows, 1:] += east[:, :, :-1]
            block_weights[:, 1, rows] += west
            block_weights[:, 2, rows] = rising
            block_weights[:, 3, rows] = falling
        places = self._positions.reshape(-1, 3).T
        factors = self._special_coefficient(values, softening)
        irregular = self._add_special(places, factors, 0.0, weights, None)
        return Stencil(self.topology, weights, irregular)

    def coefficient(self, values: Floats, softening: Floats, power: float) -> CellCoefficient:
        """Coefficient of a surface that moves, from values at the texels at rest [C, n, n].

        For the values and the softening see `TexelMesh.stencil`.
        """
        values = self.topology.with_halo(values)
        softening = self.topology.with_halo(softening)
        at_quads = _with_zeros(conductance(at_corners(values), at_corners(softening)))
        at_quads = np.where(self._per_area > 0, at_quads, _ZERO)
        quads = QuadCells(at_quads, self._per_area, self._scale, power, self._detours)
        return quads, self._special_coefficient(values, softening)

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
        """Weights at `special_links` from all cells but the quads, and the irregular links.

        Only the places at `special_places` of the coordinates around are read.
        """
        weights = self._empty
        quads, special = coefficient
        links = self._add_special(around.reshape(3, -1), special, quads.power, weights, None)
        values = weights.reshape(-1)[self.special_links]
        weights.reshape(-1)[self.special_links] = 0.0
        return values, links

    @functools.cached_property
    def special_places(self) -> Ints:
        """Flat places, of a field with halo, of the corners of all cells but the quads."""
        places = [np.zeros(0, np.int64)]
        places += [cells.corners.ravel() for cells in self._special]
        return np.unique(np.concatenate(places))

    @functools.cached_property
    def special_links(self) -> Ints:
        """Flat places, among a stencil's weights, of links to which special cells add.

        All copies of a link count.
        """
        is_special = np.zeros(self._shape)
        for cells in self._special:
            _, places = cells.links
            is_special.reshape(-1)[places] = 1.0
        crossing_links(self.topology).level(is_special)
        return np.flatnonzero(is_special)

    @functools.cached_property
    def _empty(self) -> Floats:
        return np.zeros(self._shape)

    @functools.cached_property
    def _per_area(self) -> Floats32:
        """One over the areas of whole quads at rest, see `QuadCells`; 0 where there is none."""
        areas = self._quad_areas()
        return _with_zeros(np.divide(1, areas, out=np.zeros_like(areas), where=areas > 0))

    def _quad_areas(self) -> Floats:
        """Areas of whole quads at rest, [C, n + 1, n + 1]; 0 where there is none.

        In units of 1 / scale^2.
        """
        areas = np.empty(self._whole.shape)
        for charts, rows, _, ways in self._blocks():
            with np.errstate(invalid="ignore"):  # beyond rims there may be no positions
                quads = quad_area(*ways)
            areas[charts, rows] = np.where(self._whole[charts, rows], quads, 0.0)
        return areas

    @functools.cached_property
    def _special_per_area(self) -> list[Floats]:
        """One over the areas of the special cells at rest [1/m^2], kind by kind.

        1 for cells without area.
        """
        places = self._positions.reshape(-1, 3).T
        per_area = []
        for cells in self._special:
            areas = cells.weigh(places, self._scale)[2]
            per_area.append(1 / np.where(areas > 0, areas, 1.0))
        return per_area

    def _special_coefficient(self, values: Floats, softening: Floats) -> tuple[Floats, ...]:
        """Coefficient of the special cells, kind by kind, from fields with halo."""
        flat_values = values.reshape(-1)
        flat_softening = softening.reshape(-1)
        return tuple(
            conductance(list(flat_values[cells.corners]), list(flat_softening[cells.corners]))
            for cells in self._special
        )

    def _add_special(
        self,
        places: Floats,
        factors: tuple[Floats, ...],
        power: float,
        weights: Floats,
        areas: Floats | None,
    ) -> IrregularLinks:
        """Add the special cells to weights and areas, and return the irregular links.

        Afterwards the copies of each link agree.
        """
        flat = weights.reshape(-1)
        irregular = [np.zeros(0)]
        polygon_links = []
        for kind, (cells, factor) in enumerate(zip(self._special, factors, strict=True)):
            links, shares, area = cells.weigh(places, self._scale)
            if power:
                ratio = np.maximum(area * self._special_per_area[kind], MIN_AREA_RATIO)
                factor = factor * ratio**power
            values = (factor * links).ravel()
            if areas is not None:
                np.add.at(areas.reshape(-1), cells.shares[1], shares.ravel()[cells.shares[0]])
            irregular.append(values[cells.irregular[0]])
            if cells.on_all_copies:
                polygon_links.append((cells.links[1], values[cells.links[0]]))
            else:
                np.add.at(flat, cells.links[1], values[cells.links[0]])
        flat[missing_links(self.topology)] = 0.0
        crossing_links(self.topology).level(weights)
        for link_places, values in polygon_links:
            np.add.at(flat, link_places, values)
        order = self._links.weights.astype(np.int64)
        return self._links._replace(weights=np.concatenate(irregular)[order])

    def _blocks(self) -> Iterator[tuple[slice, slice, tuple[slice, slice], list[Floats]]]:
        """Blocks of cells: their charts, their rows, their texels, and ways between these.

        The texels are slices of a field with halo, with one row more than there are rows of cells.
        The ways are scaled, and are the arguments of `quad`.
        """
        charts, _, size, _ = self._shape
        charts_in_block = max(1, _CELLS_IN_BLOCK // size**2)
        rows_in_block = max(1, _CELLS_IN_BLOCK // size)
        for first_chart in range(0, charts, charts_in_block):
            block_charts = slice(first_chart, min(first_chart + charts_in_block, charts))
            for first_row in range(0, size, rows_in_block):
                rows = slice(first_row, min(first_row + rows_in_block, size))
                texels = block_charts, slice(first_row, rows.stop + 1)
                positions = np.moveaxis(self._positions[texels], -1, 0)
                south_west, *others = at_corners(self._scale * positions)
                ways = [corner - south_west for corner in others]
                yield block_charts, rows, texels, ways


def _with_zeros(quads: Floats) -> Floats32:
    """Values of quads [C, n + 1, n + 1] at their south-west corners, in a field with halo."""
    return np.pad(quads, ((0, 0), (0, 1), (0, 1))).astype(np.float32)
