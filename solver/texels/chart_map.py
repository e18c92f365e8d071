"""Chart maps, from points of the mesh to places on the charts; each layout has its own.

Each chart map has a compiled loop for the texels of points, since contacts need them at every step.
The chart map in this module is linear in each triangle: corners lie at rows and columns of one
chart.
"""

from __future__ import annotations

import dataclasses
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..kernel import Floats, Ints, kernel
from ..mesh.mesh import Mesh
from .barycentrics import barycentrics_at, barycentrics_in

# Parts of triangles: the triangle of each, in ascending order, [p]; where in it the part's three
# corners lie, in its winding, [p, 3, 3]; and values that belong to the parts, [p, ...].
Parts: TypeAlias = tuple[Ints, Floats, NDArray]


class ChartMap(Protocol):
    """Maps the triangles of a mesh to charts.

    Within a triangle, or a part of it, everything is linear in *map coordinates*, of which only the
    layout knows the meaning: directions on the sphere, or rows and columns.
    """

    @property
    def layout(self) -> str:
        """Name of the layout."""

    def coordinates(self, mesh: Mesh, triangles: Ints, points: Floats) -> Floats:
        """Map coordinates [k, d] of points [k, 3] [m] that lie on triangles [k]."""

    def chart_points(self, coordinates: Floats, resolution: int) -> tuple[Ints, Floats, Floats]:
        """Chart, row and column, each [k], of map coordinates.

        Row and column 0.0 are at the centre of the first texel.
        """

    def texels_at(self, mesh: Mesh, resolution: int, triangles: Ints, points: Floats) -> Ints:
        """Flat indices [k] of the texels that contain points [k, 3] [m] on triangles [k]."""

    def linear_parts(self, mesh: Mesh) -> Parts:
        """Parts of the mesh's triangles in which map coordinates are linear.

        With the parts come the map coordinates at their corners [p, 3, d].
        """

    def split(self, corners: Floats) -> Parts:
        """Cut triangles where they leave a chart.

        `corners` [m, 3, d] are map coordinates. With the parts come their charts [p].
        """

    def uv(self, coordinates: Floats, chart: Ints) -> Floats:
        """Places [k, ..., 2] in charts [k], 0 to 1, of map coordinates [k, ..., d]."""

    def quality(self, mesh: Mesh) -> dict[str, float]:
        """Figures of merit of the map itself; see `Atlas.quality`."""

    def arrays(self) -> dict[str, NDArray]:
        """Arrays that the chart map can be rebuilt from."""


def uncut(values: NDArray) -> Parts:
    """Triangles that are not cut, each one part, with values that belong to them [m, ...]."""
    return np.arange(len(values)), np.broadcast_to(np.eye(3), (len(values), 3, 3)), values


@dataclasses.dataclass(frozen=True, eq=False)
class TextureCoordinates:
    """The triangles of a mesh, cut at the borders of charts, with coordinates into the atlas.

    Attributes
    ----------
    triangle : int64 [piece_count]
        Triangle of the mesh of which each piece is a part, in ascending order. Most are not cut:
        one piece, the whole.
    barycentrics : float64 [piece_count, 3, 3]
        Where in that triangle the piece's three corners lie, in the winding of the mesh.
    chart : int64 [piece_count]
        Chart of the atlas, the layer of a texture array.
    coordinates : float64 [piece_count, 3, d]
        Map coordinates of the corners; see `ChartMap`.
    uv : float64 [piece_count, 3, 2]
        Place in the chart at each corner, 0 to 1: (column + 1/2) / n and (row + 1/2) / n, whatever
        the resolution n. In a layer with a halo of one texel it is at (1 + n uv) / (n + 2).
    """

    triangle: Ints
    barycentrics: Floats
    chart: Ints
    coordinates: Floats
    uv: Floats

    def carry(self, corner_values: Floats) -> Floats:
        """Values at the corners of pieces of a function that is linear in each triangle.

        Parameters
        ----------
        corner_values : [triangle_count, 3, ...]
            Values at the corners of the mesh's triangles, such as `mesh.V[mesh.F]` or
            `mesh.corner_uv`.

        Returns
        -------
        [piece_count, 3, ...]
        """
        return np.einsum(
            "pij,pj...->pi...", self.barycentrics, np.asarray(corner_values)[self.triangle]
        )


def texture_coordinates(chart_map: ChartMap, mesh: Mesh) -> TextureCoordinates:
    """Coordinates into the atlas at every corner of every triangle of a mesh.

    See `Atlas.texture_coordinates`.
    """
    triangle, part_barycentrics, part_coordinates = chart_map.linear_parts(mesh)
    part, within, chart = chart_map.split(part_coordinates)
    barycentrics = np.einsum("pij,pjk->pik", within, part_barycentrics[part])
    coordinates = np.einsum("pij,pjk->pik", within, part_coordinates[part])
    uv = chart_map.uv(coordinates, chart)
    return TextureCoordinates(triangle[part], barycentrics, chart, coordinates, uv)


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

    charts: Ints
    corners: Floats
    resolution: int

    @property
    def layout(self) -> str:
        """Name of the layout."""
        return "given"

    def coordinates(self, mesh: Mesh, triangles: Ints, points: Floats) -> Floats:
        """Chart, row and column, [k, 3], of points [k, 3] [m] that lie on triangles [k]."""
        weights = barycentrics_in(mesh.V[mesh.F[triangles]], points)
        places = np.einsum("kc,kcj->kj", weights, self.corners[triangles])
        return np.concatenate([self.charts[triangles, None], places], axis=1)

    def chart_points(self, coordinates: Floats, resolution: int) -> tuple[Ints, Floats, Floats]:
        """Chart, row and column, each [k]."""
        return coordinates[:, 0].astype(np.int64), coordinates[:, 1], coordinates[:, 2]

    def texels_at(self, mesh: Mesh, resolution: int, triangles: Ints, points: Floats) -> Ints:
        """Flat indices [k] of the texels that contain points [k, 3] [m] on triangles [k]."""
        charts = self.charts[triangles]
        corners = np.ascontiguousarray(self.corners[triangles])
        return _texels_on_charts(mesh.V[mesh.F[triangles]], charts, corners, resolution, points)

    def linear_parts(self, mesh: Mesh) -> Parts:
        """The triangles, with chart, row and column of their corners."""
        chart = np.broadcast_to(self.charts[:, None, None], (len(self.charts), 3, 1))
        return uncut(np.concatenate([chart, self.corners], axis=2))

    def split(self, corners: Floats) -> Parts:
        """The triangles as they are: each lies in one chart."""
        return uncut(corners[:, 0, 0].astype(np.int64))

    def uv(self, coordinates: Floats, chart: Ints) -> Floats:
        """Place [k, ..., 2] in the charts, 0 to 1, of map coordinates [k, ..., 3]."""
        return np.clip((coordinates[..., [2, 1]] + 0.5) / self.resolution, 0.0, 1.0)

    def quality(self, mesh: Mesh) -> dict[str, float]:
        """No figures: only whoever laid the triangles out has them."""
        return {}

    def arrays(self) -> dict[str, NDArray]:
        """Charts and corners of the triangles."""
        return {"charts": self.charts, "corners": self.corners}


@kernel
def _texels_on_charts(
    triangles: Floats, charts: Ints, corners: Floats, n: int, points: Floats
) -> Ints:
    """Texels [k] of points [k, 3] on triangles [k, 3, 3] [m].

    `corners` [k, 3, 2] are row and column of the triangles' corners in charts [k].
    """
    texels = np.empty(len(points), np.int64)
    for i in range(len(points)):
        s, t = barycentrics_at(triangles[i], points[i])
        texel = charts[i]
        for k in range(2):
            place = (1 - s - t) * corners[i, 0, k] + (s * corners[i, 1, k] + t * corners[i, 2, k])
            texel = texel * n + min(max(int(np.rint(place)), 0), n - 1)
        texels[i] = texel
    return texels
