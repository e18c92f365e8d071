"""Texels whose surface moves: where they are on the triangles of a mesh, and their stencils, made when asked for."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints32, kernel
from .atlas import Atlas
from .chart_map import barycentrics_in
from .stencil import NO_LINKS, IrregularLinks, Stencil
from .stiffness import CellCoefficient, TexelCells

# Rest positions further off their triangles than this, in units of the surface's size, keep that
# distance.
_OFF = 1e-9


class SurfaceRide:
    """All places of an atlas, with halo, on vertices that move: each keeps its triangle and its place in it.

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
        Whether all lie in their triangles: none is off, and none shows a texel where it is not.
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
        if (at := rim & ~nothing).any():
            triangle, closest = atlas.closest_points(np.ascontiguousarray(places[at]))
            corners[at] = F[triangle]
            weights[at] = barycentrics_in(V[F[triangle]], closest)
        weights[nothing] = np.nan
        # images of a periodic surface keep their way to the texels that they show
        shift = np.where(
            (rim | nothing)[:, None], 0.0, places - atlas.positions.reshape(-1, 3)[halo]
        )
        self._images = np.flatnonzero(shift.any(axis=1))
        self._shift = shift[self._images].T
        self.corners = corners.astype(np.int32)
        self.weights = weights
        self._offsets = np.zeros((0, 3))
        # along the triangle's first side, across it, and along its normal, in units of the root of
        # twice its area
        off = np.nan_to_num(places - shift - np.einsum("ij,ijk->ik", weights, V[corners]))
        if np.abs(off).max(initial=0.0) > _OFF * np.ptp(V, axis=0).max():
            self._offsets = np.linalg.solve(
                np.swapaxes(_frames(V, self.corners), 1, 2), off[..., None]
            )[..., 0]
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
        """Positions of the texels [C, n, n, 3] and what lies beyond them; see `TexelMesh`."""
        around = np.ascontiguousarray(np.moveaxis(self.around(V), 0, -1))
        return around[:, 1:-1, 1:-1].copy(), around if self._has_beyond else None

    def normals(self, vertex_normals: Floats) -> Floats:
        """Unit normals of the texels [C, n, n, 3], from those of the vertices [n, 3]."""
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
    """A stencil of cells and where they are.

    A GPU makes its own of it, so that nobody may ever ask for the weights.

    Parameters
    ----------
    multiple : (MovedStencil, float), optional
        One of which this is a multiple, and by how much.
    added : IrregularLinks, optional
        Links that stay as they are wherever the places are; no part of a multiple.

    Attributes
    ----------
    known_fastest : float or None
        What `fastest` gives, where a GPU has found it.
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
    def _made(self) -> tuple[Stencil, Floats]:
        if self._multiple is None:
            return self.cells.moved(self.places.around, self.coefficient)
        (stencil, areas) = self._multiple[0]._made
        factor = self._multiple[1]
        links = stencil.irregular._replace(weights=factor * stencil.irregular.weights)
        return Stencil(self.topology, factor * stencil.weights, links), areas

    @functools.cached_property
    def weights(self) -> Floats:  # type: ignore[override]
        """Weights of the nine-point stencil, [C, 4, n + 1, n + 1]."""
        return self._made[0].weights

    @functools.cached_property
    def irregular(self) -> IrregularLinks:  # type: ignore[override]
        """The links beyond the nine points."""
        return self.with_added(self._made[0].irregular)

    def with_added(self, links: IrregularLinks) -> IrregularLinks:
        """Irregular links of the cells, and those that stay."""
        return IrregularLinks.joined(links, self._added)

    @property
    def areas(self) -> Floats:
        """Area of the texel mesh that belongs to each texel [m^2], [C, n, n]."""
        return self._made[1]

    def fastest(self, mass: Floats) -> float:
        """Bound of the largest eigenvalue as for any stencil, or the one that is known."""
        return super().fastest(mass) if self.known_fastest is None else self.known_fastest


def _frames(V: Floats, corners: NDArray[np.integer]) -> Floats:
    """First side, direction across it, and normal of triangles, as rows as long as the root of twice the area."""
    x = V[corners]
    along = x[:, 1] - x[:, 0]
    across = x[:, 2] - x[:, 0]
    normal = np.cross(along, across)
    double = np.linalg.norm(normal, axis=1)[:, None]
    normal /= np.maximum(double, 1e-300)
    along /= np.maximum(np.linalg.norm(along, axis=1)[:, None], 1e-300)
    return np.sqrt(double)[..., None] * np.stack([along, np.cross(normal, along), normal], axis=1)


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
    """Unit vectors between those of vertices [n, 3], at the texels among places with halo, into [C, n, n, 3]."""
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
