"""The way from a point of the mesh to its place on the charts, which each layout knows in its own manner."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..mesh.mesh import Mesh
from .topology import TexelTopology


class ChartMap(Protocol):
    """Maps the triangles of a mesh to charts.

    Within a triangle, or a part of it, everything is linear in *map coordinates*, of which only the layout knows the
    meaning: directions on the sphere, or rows and columns.
    """

    @property
    def layout(self) -> str:
        """Name of the layout."""

    def coordinates(self, mesh: Mesh, triangles: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map coordinates [k, d] of points [k, 3] [m] that lie on triangles [k]."""

    def chart_points(
        self, coordinates: NDArray[np.float64], resolution: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Chart, row and column, each [k], of map coordinates; 0.0 is the centre of the first texel."""

    def compiled(self, mesh: Mesh, topology: TexelTopology) -> Any:
        """What compiled code asks for the texels of points, a NamedTuple of arrays; see `texel_on`."""

    def linear_parts(self, mesh: Mesh) -> LinearParts:
        """Parts of the mesh's triangles in which map coordinates are linear."""

    def split(self, corners: NDArray[np.float64]) -> ChartPieces:
        """Cut triangles with the map coordinates [m, 3, d] at their corners where they leave a chart."""

    def uv(self, coordinates: NDArray[np.float64], chart: NDArray[np.int64]) -> NDArray[np.float64]:
        """Place [k, ..., 2] in charts [k], 0 to 1, of map coordinates [k, ..., d] that belong to them."""

    def quality(self, mesh: Mesh) -> dict[str, float]:
        """Figures of merit of the map itself; see `Atlas.quality`."""

    def arrays(self) -> dict[str, NDArray]:
        """What has to be stored to make the chart map again."""


class ChartPieces(NamedTuple):
    """Triangles cut so that each piece lies in one chart; most are not cut: one piece, the whole.

    Attributes
    ----------
    triangle : int64 [piece_count]
        Of which each piece is a part, in ascending order.
    barycentrics : float64 [piece_count, 3, 3]
        Where in that triangle the piece's three corners lie, in its winding.
    chart : int64 [piece_count]
    """

    triangle: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    chart: NDArray[np.int64]

    @classmethod
    def uncut(cls, chart: NDArray[np.int64]) -> ChartPieces:
        """Triangles that each lie in one chart [m]."""
        return cls(np.arange(len(chart)), np.tile(np.eye(3), (len(chart), 1, 1)), chart)


class LinearParts(NamedTuple):
    """Parts of a mesh's triangles in which map coordinates are linear.

    Attributes
    ----------
    triangle : int64 [part_count]
        Of which each is a part, in ascending order.
    barycentrics : float64 [part_count, 3, 3]
        Where in that triangle the part's three corners lie, in its winding.
    coordinates : float64 [part_count, 3, d]
        Map coordinates of the corners.
    """

    triangle: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    coordinates: NDArray[np.float64]

    @classmethod
    def whole(cls, coordinates: NDArray[np.float64]) -> LinearParts:
        """Triangles with the map coordinates [face_count, 3, d] at their corners, each one part."""
        count = len(coordinates)
        return cls(np.arange(count), np.broadcast_to(np.eye(3), (count, 3, 3)), coordinates)


@dataclasses.dataclass(frozen=True, eq=False)
class TextureCoordinates:
    """The triangles of a mesh, cut where they cross the border of a chart, with coordinates into the atlas.

    Attributes
    ----------
    triangle : int64 [piece_count]
        Triangle of the mesh of which each piece is a part, in ascending order. Most are not cut: one piece, the whole.
    barycentrics : float64 [piece_count, 3, 3]
        Where in that triangle the piece's three corners lie, in the winding of the mesh.
    chart : int64 [piece_count]
        Chart of the atlas, the layer of a texture array.
    coordinates : float64 [piece_count, 3, d]
        Map coordinates of the corners; see `ChartMap`.
    uv : float64 [piece_count, 3, 2]
        Place in the chart at each corner, 0 to 1: (column + 1/2) / n and (row + 1/2) / n, whatever the resolution n.
        In a layer with a halo of one texel it is at (1 + n uv) / (n + 2).
    """

    triangle: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    chart: NDArray[np.int64]
    coordinates: NDArray[np.float64]
    uv: NDArray[np.float64]

    def carry(self, corner_values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at the pieces' corners of what is linear in each triangle of the mesh.

        Parameters
        ----------
        corner_values : [triangle_count, 3, ...]
            Values at the corners of the mesh's triangles, such as `mesh.V[mesh.F]` or `mesh.corner_uv`.

        Returns
        -------
        [piece_count, 3, ...]
        """
        return np.einsum("pij,pj...->pi...", self.barycentrics, np.asarray(corner_values)[self.triangle])


def texture_coordinates(chart_map: ChartMap, mesh: Mesh) -> TextureCoordinates:
    """Coordinates into the atlas at every corner of every triangle of a mesh; see `Atlas.texture_coordinates`."""
    parts = chart_map.linear_parts(mesh)
    part, within, chart = chart_map.split(parts.coordinates)
    coordinates = np.einsum("pij,pjk->pik", within, parts.coordinates[part])
    barycentrics = np.einsum("pij,pjk->pik", within, parts.barycentrics[part])
    return TextureCoordinates(parts.triangle[part], barycentrics, chart, coordinates, chart_map.uv(coordinates, chart))
