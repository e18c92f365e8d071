"""Stiffness of a texel mesh whose texels move: what stays is worked out once, the rest is filled in anew."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .cell_sums import conductances
from .cells import quad_area
from .irregular import IrregularLinks
from .links import CrossingLinks, link_exists, ties_to_rim
from .quad_pass import LEAST_RATIO, QuadCells, quad_pass
from .special_cells import special_cells, whole_quads
from .stencil import Stencil
from .texel_mesh import TexelMesh

Floats = NDArray[np.float64]

_CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))


class CellCoefficient(NamedTuple):
    """A coefficient at rest: of the quads, see `QuadCells`, and of the special cells, kind by kind, each [k]."""

    quads: QuadCells
    special: tuple[Floats, ...]


class MovingCells:
    """The cells of a texel mesh, for any positions of its texels.

    A coefficient goes with a power of each cell's area over that at rest: with -1 what is spread over the surface, such
    as its density, gets thinner as that stretches.

    Parameters
    ----------
    texels : TexelMesh
        At rest.
    """

    def __init__(self, texels: TexelMesh) -> None:
        self._topology = topology = texels.topology
        charts, n, _ = topology.shape
        self._shape, around = (charts, 4, n + 1, n + 1), texels.halo_positions
        self._special = special_cells(topology, around)
        self._rest = [each.weigh(around.reshape(-1, 3)[each.corners]).areas for each in self._special]
        x = [np.moveaxis(around[:, r : r + n + 1, c : c + n + 1], -1, 0) for r, c in _CORNERS]
        with np.errstate(invalid="ignore"):
            areas = np.where(whole_quads(topology), quad_area(*x), 0.0)
        self._scale = float(1 / np.sqrt(areas[areas > 0].mean())) if areas.any() else 1.0
        areas *= self._scale**2
        self._per_area: NDArray[np.float32] = np.divide(1, areas, out=np.zeros_like(areas), where=areas > 0).astype(
            np.float32
        )
        self._clear, self._copies, self._pair = _borders(texels)
        self._pair_sizes = np.bincount(self._pair)
        ends = np.concatenate([np.zeros((0, 2), np.int64), *(each.irregular[1] for each in self._special)])
        self._links = IrregularLinks.of(ends, np.arange(len(ends), dtype=np.float64))

    def coefficient(self, values: Floats, softening: Floats, power: float) -> CellCoefficient:
        """Of values at the texels at rest [C, n, n]; `softening` as for `stiffness_stencil`."""
        k, s = (self._topology.with_halo(field) for field in (values, softening))
        size = self._shape[-1]
        with np.errstate(divide="ignore"):
            quads = conductances(*([field[:, r : r + size, c : c + size] for r, c in _CORNERS] for field in (k, s)))
            special = tuple(
                conductances(*(list(field.reshape(-1)[each.corners].T) for field in (k, s))) for each in self._special
            )
        at_rest = np.where(self._per_area > 0, quads, 0.0).astype(np.float32)
        return CellCoefficient(QuadCells(at_rest, self._per_area, self._scale, power), special)

    def assemble(self, around: Floats, coefficient: CellCoefficient) -> tuple[Stencil, Floats]:
        """Stiffness weights, and the area that belongs to each texel [m^2], [C, n, n].

        Parameters
        ----------
        around : float64 [C, n + 2, n + 2, 3]
            Positions with halo [m], see `TexelMesh`.
        coefficient : CellCoefficient
        """
        weights, areas = np.zeros(self._shape), np.zeros(self._topology.shape)
        x, y, z = (np.ascontiguousarray(around[..., k]) for k in range(3))
        quad_pass(x, y, z, coefficient.quads, weights, areas)
        flat, flat_areas, irregular = weights.reshape(-1), areas.reshape(-1), []
        points, power = around.reshape(-1, 3), coefficient.quads.power
        of_polygons = []
        for cells, rest, at_rest in zip(self._special, self._rest, coefficient.special, strict=True):
            added = cells.weigh(points[cells.corners])
            ratio = np.maximum(added.areas / np.where(rest > 0, rest, 1.0), LEAST_RATIO)
            links = (added.links * (at_rest * ratio**power)[:, None]).reshape(-1)
            np.add.at(flat_areas, cells.shares[1], added.shares.reshape(-1)[cells.shares[0]])
            mine = cells.links[1], links[cells.links[0]]
            if cells.on_all_copies:
                of_polygons.append(mine)
            else:
                np.add.at(flat, *mine)
            irregular.append(links[cells.irregular[0]])
        flat[self._clear] = 0.0
        copies = flat[self._copies]
        flat[self._copies] = (np.bincount(self._pair, copies) / self._pair_sizes)[self._pair]
        for mine in of_polygons:
            np.add.at(flat, *mine)
        if self._links is None:
            return Stencil(self._topology, weights), areas
        beside = np.concatenate(irregular)[self._links.weights.astype(np.int64)]
        return Stencil(self._topology, weights, self._links._replace(weights=beside)), areas


def _borders(texels: TexelMesh) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Flat places, among a stencil's weights, of what is no link, and of the copies of links; the pair of each copy."""
    topology = texels.topology
    charts, n, _ = topology.shape
    shape = charts, 4, n + 1, n + 1
    missing = np.zeros(shape, bool)
    for link in range(4):
        missing[:, link] = ~(link_exists(topology, link) | ties_to_rim(topology, link))
    crossing = CrossingLinks.of(topology)
    _, pair = np.unique(crossing.keys, return_inverse=True)
    return np.flatnonzero(missing), np.ravel_multi_index(crossing.places, shape), pair
