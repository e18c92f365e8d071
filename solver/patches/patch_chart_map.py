"""The patch layout's chart map: the mesh's triangles cut into pieces, on each of which it is linear."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Floats, Ints, kernel
from ripple_sim.solver.mesh.mesh import Mesh
from ripple_sim.solver.texels.barycentrics import barycentrics_in
from ripple_sim.solver.texels.chart_map import ChartPieces, LinearParts
from ripple_sim.solver.texels.topology import TexelTopology

from .pieces import Pieces
from .quality import map_quality


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

    def nearest_texels(self, coordinates: NDArray[np.float64], topology: TexelTopology) -> NDArray[np.int64]:
        """Flat index of the texel in which each place lies, [k]."""
        n = topology.shape[1]
        chart, row, column = self.chart_points(coordinates, n)
        place = np.clip(np.rint([row, column]).astype(np.int64), 0, n - 1)
        return (chart * n + place[0]) * n + place[1]

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
        best = -np.inf
        piece[i], inside[i] = min(first[triangles[i]], len(corners) - 1), 1 / 3
        for p in range(first[triangles[i]], first[triangles[i] + 1]):
            a, b, c = corners[p]
            ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
            dx, dy = weights[i, 0] - a[0], weights[i, 1] - a[1]
            area = ux * vy - uy * vx
            if not area > 0:
                continue
            s, t = (dx * vy - dy * vx) / area, (ux * dy - uy * dx) / area
            least = min(s, t, 1 - s - t)
            if least > best:
                best, piece[i] = least, p
                s, t = min(max(s, 0.0), 1.0), min(max(t, 0.0), 1.0)
                excess = max(s + t, 1.0)
                inside[i, 1], inside[i, 2] = s / excess, t / excess
                inside[i, 0] = 1 - inside[i, 1] - inside[i, 2]
