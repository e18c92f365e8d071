"""A chart map that is linear in each triangle: its corners lie at rows and columns of one chart."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints, variant
from ..mesh.mesh import Mesh
from .barycentrics import barycentrics_at, barycentrics_in
from .chart_map import ChartPieces, LinearParts
from .nearest import texel_on
from .topology import TexelTopology


class LinearCharts(NamedTuple):
    """Triangles in space [m], [m, 3, 3], and on the charts; see `LinearChartMap`."""

    triangles: Floats
    charts: Ints
    corners: Floats
    resolution: int


@dataclasses.dataclass(frozen=True, eq=False)
class LinearChartMap:
    """Triangles laid out on charts; map coordinates are chart, row and column. See `ChartMap`.

    Attributes
    ----------
    charts : int64 [triangle_count]
        Chart of each triangle.
    corners : float64 [triangle_count, 3, 2]
        Row and column of its corners, from -0.5 to n - 0.5.
    resolution : int
        Texels along a chart's side, n.
    """

    charts: NDArray[np.int64]
    corners: NDArray[np.float64]
    resolution: int

    @property
    def layout(self) -> str:
        """Name of the layout."""
        return "given"

    def coordinates(self, mesh: Mesh, triangles: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Chart, row and column, [k, 3], of points [k, 3] [m] that lie on triangles [k]."""
        weights = barycentrics_in(mesh.V[mesh.F[triangles]], points)
        places = np.einsum("kc,kcj->kj", weights, self.corners[triangles])
        return np.concatenate([self.charts[triangles, None], places], axis=1)

    def chart_points(
        self, coordinates: NDArray[np.float64], resolution: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Chart, row and column, each [k]."""
        return coordinates[:, 0].astype(np.int64), coordinates[:, 1], coordinates[:, 2]

    def compiled(self, mesh: Mesh, topology: TexelTopology) -> LinearCharts:
        """The triangles in space and on the charts."""
        return LinearCharts(mesh.V[mesh.F], self.charts, np.ascontiguousarray(self.corners), topology.shape[1])

    def linear_parts(self, mesh: Mesh) -> LinearParts:
        """The triangles, with chart, row and column of their corners."""
        chart = np.broadcast_to(self.charts[:, None, None], (len(self.charts), 3, 1))
        return LinearParts.whole(np.concatenate([chart, self.corners], axis=2))

    def split(self, corners: NDArray[np.float64]) -> ChartPieces:
        """The triangles as they are: each lies in one chart."""
        return ChartPieces.uncut(corners[:, 0, 0].astype(np.int64))

    def uv(self, coordinates: NDArray[np.float64], chart: NDArray[np.int64]) -> NDArray[np.float64]:
        """Place [k, ..., 2] in the charts, 0 to 1, of map coordinates [k, ..., 3]."""
        return np.clip((coordinates[..., [2, 1]] + 0.5) / self.resolution, 0.0, 1.0)

    def quality(self, mesh: Mesh) -> dict[str, float]:
        """None: whoever laid the triangles out knows."""
        return {}

    def arrays(self) -> dict[str, NDArray]:
        """Charts and corners of the triangles."""
        return {"charts": self.charts, "corners": self.corners}


@variant(texel_on, LinearCharts)
def _texel_on_linear_charts(charts: LinearCharts, triangle: int, x: float, y: float, z: float) -> int:
    s, t = barycentrics_at(charts.triangles[triangle], x, y, z)
    texel, n = charts.charts[triangle], charts.resolution
    for k in range(2):
        place = (1 - s - t) * charts.corners[triangle, 0, k]
        place += s * charts.corners[triangle, 1, k] + t * charts.corners[triangle, 2, k]
        texel = texel * n + min(max(int(np.rint(place)), 0), n - 1)
    return texel
