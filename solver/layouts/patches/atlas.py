"""The patch layout's chart map: the mesh's triangles cut into pieces, on each of which it is linear."""

from __future__ import annotations

import dataclasses
import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel import Floats, Ints, kernel, variant
from ...mesh.mesh import Mesh
from ...texels.barycentrics import barycentrics_at, barycentrics_in
from ...texels.chart_map import ChartPieces, LinearParts
from ...texels.nearest import texel_on
from ...texels.topology import TexelTopology
from .pieces import Pieces
from .quality import map_quality


class PatchCharts(NamedTuple):
    """Triangles in space [m], [m, 3, 3], the first piece of each, one behind the last, and the pieces."""

    triangles: Floats
    first: Ints
    pieces: Pieces
    resolution: int


@dataclasses.dataclass(frozen=True, eq=False)
class PatchChartMap:
    """Any mesh on charts; map coordinates are chart, column and row, the latter from 0 to 1. See `ChartMap`.

    Attributes
    ----------
    pieces : Pieces
    """

    pieces: Pieces

    @property
    def layout(self) -> str:
        """Name of the layout."""
        return "patches"

    @functools.cached_property
    def _first(self) -> NDArray[np.int64]:
        """Number of the first piece of each triangle, and one behind the last."""
        return np.searchsorted(self.pieces.triangle, np.arange(self.pieces.triangle[-1] + 2))

    def coordinates(self, mesh: Mesh, triangles: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Chart, column and row, [k, 3], of points [k, 3] [m] that lie on triangles [k]."""
        weights = barycentrics_in(mesh.V[mesh.F[triangles]], points)
        piece, inside = np.empty(len(weights), np.int64), np.empty((len(weights), 3))
        _find(self._first, self.pieces.barycentrics, triangles, weights, piece, inside)
        places = np.einsum("kc,kcj->kj", inside, self.pieces.places[piece])
        return np.concatenate([self.pieces.chart[piece, None], places], axis=1)

    def chart_points(
        self, coordinates: NDArray[np.float64], resolution: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Chart, row and column, each [k]."""
        chart, column, row = coordinates.T
        return chart.astype(np.int64), row * resolution - 0.5, column * resolution - 0.5

    def compiled(self, mesh: Mesh, topology: TexelTopology) -> PatchCharts:
        """The triangles in space, and their pieces."""
        return PatchCharts(mesh.V[mesh.F], self._first, self.pieces, topology.shape[1])

    def linear_parts(self, mesh: Mesh) -> LinearParts:
        """The pieces."""
        chart = np.broadcast_to(self.pieces.chart[:, None, None], (len(self.pieces.chart), 3, 1))
        coordinates = np.concatenate([chart, self.pieces.places], axis=2)
        return LinearParts(self.pieces.triangle, self.pieces.barycentrics, coordinates)

    def split(self, corners: NDArray[np.float64]) -> ChartPieces:
        """Parts of pieces as they are: each lies in one chart."""
        return ChartPieces.uncut(corners[:, 0, 0].astype(np.int64))

    def uv(self, coordinates: NDArray[np.float64], chart: NDArray[np.int64]) -> NDArray[np.float64]:
        """Place [k, ..., 2] in the charts, 0 to 1, of map coordinates [k, ..., 3]."""
        return np.clip(coordinates[..., 1:], 0.0, 1.0)

    def quality(self, mesh: Mesh) -> dict[str, float]:
        """Folds and stretch."""
        return map_quality(mesh, self.pieces)

    def arrays(self) -> dict[str, NDArray]:
        """The pieces."""
        return {f"piece_{name}": array for name, array in self.pieces._asdict().items()}


@kernel
def _find(first: Ints, corners: Floats, triangles: Ints, weights: Floats, piece: Ints, inside: Floats) -> None:
    """For points at barycentrics [k, 3] in triangles [k], the piece in which each lies, and barycentrics in that."""
    for i in range(len(triangles)):
        piece[i], s, t = _piece_at(first, corners, triangles[i], weights[i, 0], weights[i, 1])
        inside[i, 0], inside[i, 1], inside[i, 2] = 1 - s - t, s, t


@kernel
def _piece_at(first: Ints, corners: Floats, triangle: int, x: float, y: float) -> tuple[int, float, float]:
    """The piece of a triangle in which a point lies, and its second and third barycentric coordinate in that."""
    best, piece, at_s, at_t = -np.inf, min(first[triangle], len(corners) - 1), 1 / 3, 1 / 3
    for p in range(first[triangle], first[triangle + 1]):
        a, b, c = corners[p]
        ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
        dx, dy = x - a[0], y - a[1]
        area = ux * vy - uy * vx
        if not area > 0:
            continue
        s, t = (dx * vy - dy * vx) / area, (ux * dy - uy * dx) / area
        least = min(s, t, 1 - s - t)
        if least > best:
            best, piece = least, p
            s, t = min(max(s, 0.0), 1.0), min(max(t, 0.0), 1.0)
            excess = max(s + t, 1.0)
            at_s, at_t = s / excess, t / excess
    return piece, at_s, at_t


@variant(texel_on, PatchCharts)
def _texel_on_patches(charts: PatchCharts, triangle: int, x: float, y: float, z: float) -> int:
    pieces, n = charts.pieces, charts.resolution
    s, t = barycentrics_at(charts.triangles[triangle], x, y, z)
    piece, s, t = _piece_at(charts.first, pieces.barycentrics, triangle, 1 - s - t, s)
    texel = pieces.chart[piece]
    for k in (1, 0):
        place = (1 - s - t) * pieces.places[piece, 0, k]
        place += s * pieces.places[piece, 1, k] + t * pieces.places[piece, 2, k]
        texel = texel * n + min(max(int(np.rint(place * n - 0.5)), 0), n - 1)
    return texel
