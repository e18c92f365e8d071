"""Texels on a surface that moves: their places on triangles, and stencils that are made late."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints32, kernel
from .atlas import Atlas
from .barycentrics import barycentrics_in
from .stencil import NO_LINKS, IrregularLinks, Stencil
from .stiffness import CellCoefficient, TexelCells

# Distance of a place at rest from its triangle, in units of the size of the surface, above which
# the place keeps this distance; less is round-off.
_MIN_OFFSET = 1e-9

# Lengths and areas by which vectors are divided, at least.
_MIN_DIVISOR = 1e-300


class SurfaceRide:
    """All places of an atlas, with halo, on vertices that move.

    Each place keeps its triangle, and where it lies in it.

    Parameters
    ----------
    atlas : Atlas
        At rest.

    Attributes
    ----------
    corners : int32 [k, 3]
        Vertices of the places' triangles.
    weights : float64 [k, 3]
        Barycentric coordinates; NaN where there is nothing.
    on_triangles : bool
        Whether all places lie in their triangles: none is off its triangle, and none is the image
        of a texel elsewhere.
    """

    def __init__(self, atlas: Atlas) -> None:
        topology = atlas.texels.topology
        around = atlas.texels.halo_positions
        self._shape = topology.halo.shape
        self._has_beyond = atlas.texels.beyond is not None
        V = atlas.mesh.V
        F = np.asarray(atlas.mesh.F, np.int64)
        places = around.reshape(-1, 3)
        halo = topology.halo.reshape(-1)
        rim = topology.rim.reshape(-1)
        nothing = ~np.isfinite(places[:, 0])
        corners = F[atlas.triangles.reshape(-1)[halo]]
        weights = atlas.barycentrics.reshape(-1, 3)[halo]
        on_rim = rim & ~nothing
        if on_rim.any():
            triangle, closest = atlas.closest_points(np.ascontiguousarray(places[on_rim]))
            corners[on_rim] = F[triangle]
            weights[on_rim] = barycentrics_in(V[F[triangle]], closest)
        weights[nothing] = np.nan
        # images of a periodic surface keep their way to the texels that they show
        texel_places = atlas.positions.reshape(-1, 3)[halo]
        shift = np.where((rim | nothing)[:, None], 0.0, places - texel_places)
        self._images = np.flatnonzero(shift.any(axis=1))
        self._shift = shift[self._images].T
        self.corners = corners.astype(np.int32)
        self.weights = weights
        # ways from the triangles to the places: along the first side of the triangle, across it,
        # and along its normal, in units of the root of twice its area
        self._offsets = np.zeros((0, 3))
        on_triangles = np.einsum("ij,ijk->ik", weights, V[corners])
        offsets = np.nan_to_num(places - shift - on_triangles)  # [m]
        if np.abs(offsets).max(initial=0.0) > _MIN_OFFSET * np.ptp(V, axis=0).max():
            frames = np.swapaxes(_frames(V, self.corners), 1, 2)
            self._offsets = np.linalg.solve(frames, offsets[..., None])[..., 0]
        self.on_triangles = not (len(self._offsets) or len(self._images))

    def around(self, V: Floats) -> Floats:
        """Coordinates of the texels with halo, [3, C, n + 2, n + 2]; NaN where there is nothing."""
        points = np.empty((3, len(self.corners)))
        interpolate(V, self.corners, self.weights, points)
        if len(self._offsets):
            points += np.einsum("ij,ijk->ki", self._offsets, _frames(V, self.corners))
        if len(self._images):
            points[:, self._images] += self._shift
        return points.reshape(3, *self._shape)

    def positions(self, V: Floats) -> tuple[Floats, Floats | None]:
        """Positions of the texels [C, n, n, 3] [m], and `beyond` of `TexelMesh`."""
        around = np.ascontiguousarray(np.moveaxis(self.around(V), 0, -1))
        return around[:, 1:-1, 1:-1].copy(), around if self._has_beyond else None

    def normals(self, vertex_normals: Floats) -> Floats:
        """Unit normals of the texels [C, n, n, 3] from normals of the vertices [n, 3]."""
        charts, width, _ = self._shape
        normals = np.empty((charts, width - 2, width - 2, 3))
        _interpolate_units(vertex_normals, self.corners, self.weights, normals)
        return normals


class MovedPlaces:
    """Where the places of an atlas are, with its vertices at V [n, 3] [m]."""

    def __init__(self, ride: SurfaceRide, V: Floats) -> None:
        self.ride = ride
        self.V = V

    @functools.cached_property
    def around(self) -> Floats:
        """Coordinates of the texels with halo [m], [3, C, n + 2, n + 2]."""
        return self.ride.around(self.V)


class MovedStencil(Stencil):
    """A stencil whose weights are worked out from cells and their places when they are first read.

    A GPU works out weights of its own, and then these may never be read.

    Parameters
    ----------
    cells : TexelCells
    coefficient : CellCoefficient
    places : MovedPlaces
    multiple : (MovedStencil, float), optional
        A stencil of which this one is a multiple, and the factor.
    added : IrregularLinks, optional
        Links that stay as they are wherever the places are; they are no part of a multiple.

    Attributes
    ----------
    known_fastest : float or None
        Result of `fastest`, where a GPU has worked it out.
    """

    def __init__(
        self,
        cells: TexelCells,
        coefficient: CellCoefficient,
        places: MovedPlaces,
        multiple: tuple[MovedStencil, float] | None = None,
        added: IrregularLinks = NO_LINKS,
    ) -> None:
        self.topology = cells.topology
        self.cells = cells
        self.coefficient = coefficient
        self.places = places
        self._multiple = multiple
        self._added = added
        self.known_fastest: float | None = None

    @functools.cached_property
    def _stencil_and_areas(self) -> tuple[Stencil, Floats]:
        """The stencil of the cells, without added links, and the areas [m^2], [C, n, n]."""
        if self._multiple is None:
            return self.cells.moved(self.places.around, self.coefficient)
        original, factor = self._multiple
        stencil, areas = original._stencil_and_areas
        links = stencil.irregular._replace(weights=factor * stencil.irregular.weights)
        return Stencil(self.topology, factor * stencil.weights, links), areas

    @functools.cached_property
    def weights(self) -> Floats:  # type: ignore[override]
        """Weights of the nine-point stencil, [C, 4, n + 1, n + 1]."""
        return self._stencil_and_areas[0].weights

    @functools.cached_property
    def irregular(self) -> IrregularLinks:  # type: ignore[override]
        """The links beyond the nine points."""
        return self.with_added(self._stencil_and_areas[0].irregular)

    def with_added(self, links: IrregularLinks) -> IrregularLinks:
        """Irregular links of the cells, and the added links."""
        return IrregularLinks.joined(links, self._added)

    @property
    def areas(self) -> Floats:
        """Area of the texel mesh that belongs to each texel [m^2], [C, n, n]."""
        return self._stencil_and_areas[1]

    def fastest(self, mass: Floats) -> float:
        """Gershgorin's bound of the largest eigenvalue; `known_fastest` where it is known."""
        return super().fastest(mass) if self.known_fastest is None else self.known_fastest


def _frames(V: Floats, corners: NDArray[np.integer]) -> Floats:
    """First side, direction across it, and normal of triangles, as rows [k, 3, 3].

    Each row is as long as the root of twice the area.
    """
    x = V[corners]
    along = x[:, 1] - x[:, 0]
    across = x[:, 2] - x[:, 0]
    normal = np.cross(along, across)
    double_area = np.linalg.norm(normal, axis=1)[:, None]
    normal /= np.maximum(double_area, _MIN_DIVISOR)
    along /= np.maximum(np.linalg.norm(along, axis=1)[:, None], _MIN_DIVISOR)
    units = np.stack([along, np.cross(normal, along), normal], axis=1)
    return np.sqrt(double_area)[..., None] * units


@kernel
def interpolate(values: Floats, corners: Ints32, weights: Floats, out: Floats) -> None:
    """Values [n, 3] of vertices at points with weights [k, 3] at corners [k, 3], into [3, k]."""
    for i in range(len(corners)):
        a = corners[i, 0]
        b = corners[i, 1]
        c = corners[i, 2]
        for k in range(3):
            out[k, i] = (
                weights[i, 0] * values[a, k]
                + weights[i, 1] * values[b, k]
                + weights[i, 2] * values[c, k]
            )


@kernel
def _interpolate_units(values: Floats, corners: Ints32, weights: Floats, out: Floats) -> None:
    """Unit vectors between the vectors of vertices [n, 3], at the texels, into [C, n, n, 3].

    Corners and weights are those of all places with halo.
    """
    charts, n = out.shape[:2]
    for chart in range(charts):
        for r in range(n):
            for column in range(n):
                i = (chart * (n + 2) + r + 1) * (n + 2) + column + 1
                a = corners[i, 0]
                b = corners[i, 1]
                c = corners[i, 2]
                unit = out[chart, r, column]
                square = 0.0
                for k in range(3):
                    unit[k] = (
                        weights[i, 0] * values[a, k]
                        + weights[i, 1] * values[b, k]
                        + weights[i, 2] * values[c, k]
                    )
                    square += unit[k] ** 2
                length = max(np.sqrt(square), 1e-30)
                for k in range(3):
                    unit[k] /= length
