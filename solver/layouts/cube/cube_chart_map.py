"""The cube layout's chart map: map coordinates are directions from the cube's centre."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ...mesh.mesh import Mesh
from ...texels.chart_map import ChartPieces, LinearParts
from ...texels.topology import TexelTopology
from .convention import cube_chart_points
from .edges import chart_uv, split_at_edges
from .nearest import SphereCharts, sphere_directions
from .quality import sphere_map_quality


@dataclasses.dataclass(frozen=True, eq=False)
class CubeChartMap:
    """A closed genus-0 mesh on the six charts of the cube; see `ChartMap`.

    Attributes
    ----------
    sphere : float64 [vertex_count, 3]
        Sphere map: one unit vector a vertex.
    """

    sphere: NDArray[np.float64]

    @property
    def layout(self) -> str:
        """Name of the layout."""
        return "cube"

    def coordinates(self, mesh: Mesh, triangles: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Directions [k, 3] of points [k, 3] [m] that lie on triangles [k], unit vectors."""
        return sphere_directions(mesh.V, mesh.F, self.sphere, triangles, points)

    def chart_points(
        self, coordinates: NDArray[np.float64], resolution: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Chart, row and column of directions, each [k]."""
        return cube_chart_points(coordinates, resolution)

    def compiled(self, mesh: Mesh, topology: TexelTopology) -> SphereCharts:
        """Mesh and sphere map."""
        return SphereCharts(mesh.V, mesh.F, self.sphere, topology.shape[1])

    def linear_parts(self, mesh: Mesh) -> LinearParts:
        """The triangles, with the directions of their corners."""
        return LinearParts.whole(self.sphere[mesh.F])

    def split(self, corners: NDArray[np.float64]) -> ChartPieces:
        """Cut triangles with the directions [m, 3, 3] at their corners along the edges of the cube."""
        return split_at_edges(corners)

    def uv(self, coordinates: NDArray[np.float64], chart: NDArray[np.int64]) -> NDArray[np.float64]:
        """Place [k, ..., 2] in charts [k], 0 to 1, of directions [k, ..., 3] that belong to them."""
        return chart_uv(coordinates, chart)

    def quality(self, mesh: Mesh) -> dict[str, float]:
        """Folds, stretch and starved area of the sphere map."""
        return sphere_map_quality(mesh, self.sphere)

    def arrays(self) -> dict[str, NDArray]:
        """The sphere map."""
        return {"sphere": self.sphere}
