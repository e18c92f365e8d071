"""Stiffness of a texel mesh whose texels move: what stays is worked out once, the rest is filled in anew.

The stiffness of texels that have moved, worked out when somebody asks for it.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints, kernel
from .assembly import LEAST_RATIO, Added, QuadCells, quad_pass, special_cells, whole_quads
from .cells import quad_area
from .riding import SurfaceRide
from .stencil import CrossingLinks, IrregularLinks, Stencil, link_exists, ties_to_rim
from .stiffness import conductances
from .texel_mesh import TexelMesh
from .topology import TexelTopology

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
        self.topology = topology = texels.topology
        charts, n, _ = topology.shape
        self._shape, around = (charts, 4, n + 1, n + 1), np.moveaxis(texels.halo_positions, -1, 0)
        self._special = special_cells(topology, texels.halo_positions)
        self._rest = [each.weigh(np.ascontiguousarray(around).reshape(3, -1)).areas for each in self._special]
        x = [around[..., r : r + n + 1, c : c + n + 1] for r, c in _CORNERS]
        with np.errstate(invalid="ignore"):
            areas = np.where(whole_quads(topology), quad_area(*x), 0.0)
        self._scale = float(np.float32(1 / np.sqrt(areas[areas > 0].mean()))) if areas.any() else 1.0
        areas *= self._scale**2
        self._per_area = _at_places(np.divide(1, areas, out=np.zeros_like(areas), where=areas > 0))
        self.borders = Borders.of(topology)
        ends = np.concatenate([np.zeros((0, 2), np.int64), *(each.irregular[1] for each in self._special)])
        self._links = IrregularLinks.of(ends, np.arange(len(ends), dtype=np.float64))

    def coefficient(self, values: Floats, softening: Floats, power: float) -> CellCoefficient:
        """Of values at the texels at rest [C, n, n]; `softening` as for `stiffness_stencil`."""
        k, s = (self.topology.with_halo(field) for field in (values, softening))
        size = self._shape[-1]
        with np.errstate(divide="ignore"):
            quads = conductances(*([field[:, r : r + size, c : c + size] for r, c in _CORNERS] for field in (k, s)))
            special = tuple(
                conductances(*(list(field.reshape(-1)[each.corners].T) for field in (k, s))) for each in self._special
            )
        at_rest = np.where(self._per_area > 0, _at_places(quads), np.float32(0))
        return CellCoefficient(QuadCells(at_rest, self._per_area, self._scale, power), special)

    def assemble(self, around: Floats, coefficient: CellCoefficient) -> tuple[Stencil, Floats]:
        """Stiffness weights, and the area that belongs to each texel [m^2], [C, n, n].

        Parameters
        ----------
        around : float64 [3, C, n + 2, n + 2]
            Coordinates of the texels with halo [m], see `SurfaceRide.around`.
        coefficient : CellCoefficient
        """
        weights, areas = np.empty(self._shape), np.empty(self.topology.shape)
        quad_pass(around, coefficient.quads, weights, areas)
        links = self._add_special(around, coefficient, weights.reshape(-1), areas.reshape(-1))
        return Stencil(self.topology, weights, links), areas

    def special(self, around: Floats, coefficient: CellCoefficient) -> tuple[Floats, IrregularLinks | None]:
        """What all cells but the quads give to the links at `special_links`, and the irregular links.

        Only the places at `special_places` of those around are looked at.
        """
        weights = self._empty
        links = self._add_special(around, coefficient, weights, np.zeros(self.topology.texel_count))
        values = weights[self.special_links]
        weights[self.special_links] = 0.0
        return values, links

    @functools.cached_property
    def special_places(self) -> Ints:
        """Flat places, of a field with halo, of the corners of all cells but the quads."""
        return np.unique(np.concatenate([np.zeros(0, np.int64), *(each.corners.ravel() for each in self._special)]))

    @functools.cached_property
    def special_links(self) -> Ints:
        """Flat places, among a stencil's weights, of the links to which other cells than quads add, with all copies."""
        touched = np.zeros(np.prod(self._shape), bool)
        for cells in self._special:
            touched[cells.links[1]] = True
        borders = self.borders
        if len(borders.copies):
            any_copy = np.logical_or.reduceat(touched[borders.copies], borders.begins[:-1])
            touched[borders.copies] = np.repeat(any_copy, np.diff(borders.begins))
        return np.flatnonzero(touched)

    @functools.cached_property
    def _empty(self) -> Floats:
        return np.zeros(np.prod(self._shape))

    def _add_special(
        self, around: Floats, coefficient: CellCoefficient, weights: Floats, areas: Floats
    ) -> IrregularLinks | None:
        """Add the other cells to flat weights and areas; the copies of a link then agree."""
        irregular, of_polygons = [np.zeros(0)], []
        for cells, rest, at_rest in zip(self._special, self._rest, coefficient.special, strict=True):
            added = cells.weigh(around.reshape(3, -1))
            _scale(added, rest, at_rest, coefficient.quads.power)
            _scatter(added.shares.reshape(-1), *cells.shares, areas)
            links = added.links.reshape(-1)
            if cells.on_all_copies:
                of_polygons.append((links, cells.links))
            else:
                _scatter(links, *cells.links, weights)
            irregular.append(links[cells.irregular[0]])
        _close(weights, self.borders)
        for links, places in of_polygons:
            _scatter(links, *places, weights)
        if self._links is None:
            return None
        return self._links._replace(weights=np.concatenate(irregular)[self._links.weights.astype(np.int64)])


class Borders(NamedTuple):
    """Flat places, among a stencil's weights, of what is no link, and of the copies of links, those of each together.

    Attributes
    ----------
    missing : int64 [m]
    copies : int64 [k]
    begins : int64 [p + 1]
        Where the copies of each link begin.
    """

    missing: Ints
    copies: Ints
    begins: Ints

    @classmethod
    def of(cls, topology: TexelTopology) -> Borders:
        """Those of a topology."""
        charts, n, _ = topology.shape
        shape = charts, 4, n + 1, n + 1
        missing = np.zeros(shape, bool)
        for link in range(4):
            missing[:, link] = ~(link_exists(topology, link) | ties_to_rim(topology, link))
        crossing = CrossingLinks.of(topology)
        order = np.argsort(crossing.keys, kind="stable")
        _, counts = np.unique(crossing.keys, return_counts=True)
        places = np.ravel_multi_index(crossing.places, shape)[order]
        return cls(np.flatnonzero(missing), places, np.concatenate([[0], np.cumsum(counts)]))


def _at_places(quads: Floats) -> NDArray[np.float32]:
    """Values of quads [C, n + 1, n + 1] at their south-west corners among the places of a field with halo."""
    return np.pad(quads, ((0, 0), (0, 1), (0, 1))).astype(np.float32)


@kernel
def _scale(added: Added, rest: Floats, at_rest: Floats, power: float) -> None:
    """Multiply links by what the coefficient at rest [k] has become, with the cells' areas at rest [k]."""
    for i in range(len(rest)):
        ratio = max(added.areas[i] / rest[i] if rest[i] > 0 else added.areas[i], LEAST_RATIO)
        factor = at_rest[i] * ratio**power
        for link in range(added.links.shape[1]):
            added.links[i, link] *= factor


@kernel
def _scatter(values: Floats, sources: Ints, places: Ints, out: Floats) -> None:
    """Add some of the values to places."""
    for i in range(len(sources)):
        out[places[i]] += values[sources[i]]


@kernel
def _close(weights: Floats, borders: Borders) -> None:
    """Clear what is no link, and give all copies of a link their mean."""
    for i in range(len(borders.missing)):
        weights[borders.missing[i]] = 0.0
    for pair in range(len(borders.begins) - 1):
        begin, end = borders.begins[pair], borders.begins[pair + 1]
        total = 0.0
        for i in range(begin, end):
            total += weights[borders.copies[i]]
        for i in range(begin, end):
            weights[borders.copies[i]] = total / (end - begin)


class MovedPlaces:
    """Where the places of an atlas are.

    Attributes
    ----------
    ride : SurfaceRide
    V : float64 [n, 3]
        Vertices [m].
    """

    def __init__(self, ride: SurfaceRide, V: NDArray[np.float64]) -> None:
        self.ride, self.V = ride, V

    @functools.cached_property
    def around(self) -> NDArray[np.float64]:
        """Coordinates of the texels with halo [m], [3, C, n + 2, n + 2]."""
        return self.ride.around(self.V)


class MovedStencil(Stencil):
    """A stencil of cells and where they are. A GPU makes its own of it, so that nobody may ever ask for the weights.

    Parameters
    ----------
    cells : MovingCells
    coefficient : CellCoefficient
    places : MovedPlaces
    like : (MovedStencil, float), optional
        One of which this is a multiple, and by how much.
    """

    def __init__(
        self,
        cells: MovingCells,
        coefficient: CellCoefficient,
        places: MovedPlaces,
        like: tuple[MovedStencil, float] | None = None,
    ) -> None:
        self.__dict__.update(topology=cells.topology, cells=cells, coefficient=coefficient, places=places)
        self.__dict__.update(_like=like, _fastest=None)

    cells: MovingCells
    coefficient: CellCoefficient
    places: MovedPlaces
    _like: tuple[MovedStencil, float] | None
    _fastest: float | None

    @functools.cached_property
    def _made(self) -> tuple[Stencil, NDArray[np.float64]]:
        if self._like is not None:
            return self._like[0].scaled(self._like[1]), self._like[0].areas
        return self.cells.assemble(self.places.around, self.coefficient)

    @functools.cached_property
    def weights(self) -> NDArray[np.float64]:
        """Of the nine-point stencil, [C, 4, n + 1, n + 1]."""
        return self._made[0].weights

    @functools.cached_property
    def irregular(self) -> IrregularLinks | None:
        """The links beyond the nine points."""
        return self._made[0].irregular

    @property
    def areas(self) -> NDArray[np.float64]:
        """Area of the texel mesh that belongs to each texel [m^2], [C, n, n]."""
        return self._made[1]

    def note_fastest(self, rate: float) -> None:
        """Take over what `fastest` gives from whoever knows it."""
        self.__dict__["_fastest"] = rate

    def fastest(self, mass: NDArray[np.float64]) -> float:
        """As for any stencil, or as noted."""
        return super().fastest(mass) if self._fastest is None else self._fastest
