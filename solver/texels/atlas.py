"""The atlas: a texel mesh on the surface of a mesh, each texel with its surface point."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import PATH, AtlasError, checked
from ..mesh.mesh import Mesh
from ..mesh.points import check_points
from ..mesh.queries import ClosestPoints
from .atlas_file import check_atlas_place, write_atlas_file
from .chart_map import ChartMap, TextureCoordinates, texture_coordinates
from .halo import sampling_matrix
from .texel_mesh import TexelMesh
from .texel_quality import texel_quality


@dataclasses.dataclass(frozen=True, eq=False)
class Atlas:
    """Charts of texels on the surface of a mesh.

    Make one with `build_atlas`, `sphere_atlas`, `texel_atlas` or `load_atlas`.

    Attributes
    ----------
    mesh : Mesh
        The surface.
    texels : TexelMesh
        C charts of n x n texels.
    chart_map : ChartMap
        The way from a point of the mesh to its place on the charts.
    triangles : int64 [C, n, n]
        Triangle of the mesh in which the texel lies.
    barycentrics : float64 [C, n, n, 3]
        Where in that triangle the texel lies.
    timings : dict
        Time of each stage of the construction [s].
    notes : tuple of str
        Why "auto" took this layout, where the reason is not plain.
    """

    mesh: Mesh
    texels: TexelMesh
    chart_map: ChartMap
    triangles: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    timings: dict[str, float] = dataclasses.field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def layout(self) -> str:
        """How the mesh got its charts: "cube", "patches", or "given"."""
        return self.chart_map.layout

    @property
    def sphere(self) -> NDArray[np.float64]:
        """Sphere map: one unit vector a vertex, float64 [vertex_count, 3].

        Only the cube layout has one.

        Raises
        ------
        AtlasError
            For another layout.
        """
        sphere = getattr(self.chart_map, "sphere", None)
        if sphere is None:
            raise AtlasError(
                f"an atlas of layout {self.layout!r} has no sphere map; that of layout 'cube' does"
            )
        return sphere

    @property
    def resolution(self) -> int:
        """Texels along a chart's side, N."""
        return self.texels.positions.shape[1]

    @property
    def positions(self) -> NDArray[np.float64]:
        """Surface point of every texel [m], [C, N, N, 3]."""
        return self.texels.positions

    @property
    def normals(self) -> NDArray[np.float64]:
        """Outward unit normal of every texel, [C, N, N, 3]."""
        return self.texels.normals

    @property
    def areas(self) -> NDArray[np.float64]:
        """Area of the surface that belongs to each texel [m^2], [C, N, N].

        The mass of its waves sits there.
        """
        return self.texels.areas

    def project(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Closest surface points [m], [k, 3], and their map coordinates, [k, d]; see `ChartMap`.

        Raises
        ------
        AtlasError
            If the points are not finite or not of shape [k, 3] or [3].
        """
        triangle, closest = self.closest_points(points)
        return closest, self.chart_map.coordinates(self.mesh, triangle, closest)

    def locate(
        self, points: ArrayLike
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Chart, row and column of the surface points nearest to the given points [m].

        Row and column are in texel units, 0.0 at the centre of the first texel. Each result has
        shape [k].
        """
        return self.chart_map.chart_points(self.project(points)[1], self.resolution)

    def nearest(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Closest surface points [m], [k, 3], and the flat indices of their texels, [k].

        The texel is the one nearest in the atlas.
        """
        return self.nearest_places(check_points(points))

    def nearest_places(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Like `nearest`, for points [k, 3] that need no check."""
        triangle, closest = self.closest_points.nearest(points)
        return closest, self.chart_map.texels_at(self.mesh, self.resolution, triangle, closest)

    def closest_places(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Closest surface points [m], [k, 3], without texels; for points that need no check."""
        return self.closest_points.nearest(points)[1]

    def nearest_texel(self, points: ArrayLike) -> NDArray[np.int64]:
        """Flat indices (chart N + row) N + column of the texels nearest in the atlas, [k]."""
        return self.nearest(points)[1]

    def sampling_matrix(self, points: ArrayLike) -> Any:
        """SciPy CSR matrix [k, T] from a flattened field to its values at the closest points."""
        return sampling_matrix(self.texels.topology, *self.locate(points))

    def stiffness(self, speed: float | NDArray[np.float64] = 1.0) -> Any:
        """The operator c^2 grad . grad as a symmetric SciPy CSR matrix [T, T].

        See `TexelMesh.stiffness`.
        """
        return self.texels.stiffness(speed)

    def texture_coordinates(self) -> TextureCoordinates:
        """Chart and place in it at every corner of every triangle.

        Triangles are cut where they cross the border of a chart. Places are exact at the corners.
        In between, linear interpolation of `uv` deviates in the cube layout from the sphere map's
        own place by a share of about 0.1 s^2 of a chart, where s is the angle that the triangle
        spans on the sphere: refine a mesh whose triangles span many texels before it is textured,
        or interpolate the map coordinates. The object's own texture coordinates, `mesh.uv` and
        `mesh.corner_uv`, stay as they are.
        """
        return texture_coordinates(self.chart_map, self.mesh)

    def quality(self) -> dict[str, float]:
        """Figures of merit of the atlas.

        Returns
        -------
        dict
            Of the cube layout: `solid_angle` [sr] (4 pi for a bijection). Of cube and patches:
            `flipped` triangles, area-weighted stretch quantiles `q001`, `q01`, `q50`, `q99`,
            `q999`, `starved` share of the area whose texels are over 4 times too wide. Of every
            layout: `edge_min` and `edge_max` [m], `folded` texels (their neighbours lie in the
            wrong order round them), `coverage` (texel area over mesh area: 1 but for limbs that
            fall between the texels), `spanned` (area of the mesh of texel centres over mesh area:
            it cuts creases short too), `timestep` (stable time step over that of an endless even
            grid of as many texels).
        """
        return {**self.chart_map.quality(self.mesh), **texel_quality(self.texels, self.mesh)}

    @checked(AtlasError, path=PATH)
    def save(self, path: str | Path, overwrite: bool = False) -> None:
        """Write the atlas to one file, which `load_atlas` reads.

        The file appears whole or not at all. An older atlas there is replaced, any other file only
        with `overwrite`. A link is written through.

        Raises
        ------
        AtlasError
            If the file cannot be written.
        """
        check_atlas_place(Path(path), overwrite)
        mesh = self.mesh
        texels = self.texels
        arrays = {
            "kind": np.array([type(self).__name__, self.layout]),
            "glued": texels.topology.glued,
            "V": mesh.V,
            "F": mesh.F,
            "positions": texels.positions,
            "normals": texels.normals,
            "areas": texels.areas,
            "triangles": self.triangles,
            "barycentrics": self.barycentrics,
            **self.chart_map.arrays(),
        }
        notes = np.array(self.notes) if self.notes else None
        optional = {
            "uv": mesh.uv,
            "corner_uv": mesh.corner_uv,
            "beyond": texels.beyond,
            "detours": texels.detours,
            "notes": notes,
            "still": texels.topology.still if texels.topology.still.any() else None,
        }
        present = {name: array for name, array in optional.items() if array is not None}
        write_atlas_file(Path(path), arrays | present)

    def __getstate__(self) -> dict[str, Any]:
        """State for `copy` and `pickle`, without the search tree, which can be made again."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    @functools.cached_property
    def closest_points(self) -> ClosestPoints:
        """Function that finds the nearest points of the mesh: `atlas.closest_points(points)`."""
        return ClosestPoints(self.mesh.V, self.mesh.F)
