"""The atlas of a closed genus-0 mesh in the cube layout: rays through the cube map's texels onto its sphere map.

Map coordinates are directions from the cube's centre. The analytic atlas of a sphere is the reference on which symmetry
and accuracy are tested.
"""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from ...errors import POSITIVE, AtlasError, checked
from ...kernel import Floats, Ints
from ...mesh.mesh import Mesh
from ...texels.atlas import Atlas, check_points
from ...texels.chart_map import ChartPieces, LinearParts, nearest_places
from ...texels.texel_mesh import TexelMesh
from ...texels.topology import TexelTopology, stretch_summary
from ..sphere_map import certify, stretch
from .convention import (
    chart_uv,
    check_memory,
    check_resolution,
    cube_chart_points,
    cube_topology,
    split_at_edges,
    texel_areas,
    texel_directions,
)
from .rays import Ball, SphereCharts, cast_rays, sphere_directions


def sphere_map_quality(mesh: Mesh, sphere: NDArray[np.float64]) -> dict[str, float]:
    """Flipped triangles, solid angle, quantiles of the stretch, starved share of the area; see `Atlas.quality`."""
    certificate = certify(mesh.F, sphere)
    return {
        "flipped": certificate.flipped,
        "solid_angle": certificate.solid_angle,
        **stretch_summary(stretch(mesh.V, mesh.F, sphere), mesh.triangle_areas),
    }


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


STRIDE = 16  # texels from one that is found by a ray to the next


def atlas_from_sphere_map(mesh: Mesh, sphere: NDArray[np.float64], resolution: int) -> Atlas:
    """Atlas of a mesh for a given fold-free sphere map [vertex_count, 3] (unit vectors)."""
    directions = texel_directions(check_resolution(resolution))
    # few texels lie far apart; else a divisor of the resolution, so that every row of texels begins with a ray
    stride = math.gcd(resolution, STRIDE) if directions.size > 3 * len(mesh.F) else 1
    triangles, barycentrics = cast_rays(sphere, mesh.F, directions.reshape(-1, 3), stride)
    positions, normals = _interpolate((mesh.V, mesh.vertex_normals), mesh.F, triangles, barycentrics)
    shape = directions.shape[:3]
    triangles, barycentrics = triangles.reshape(shape), barycentrics.reshape(*shape, 3)
    topology = cube_topology(resolution)
    spanned = TexelMesh.of(topology, positions.reshape(*shape, 3), normals=normals.reshape(*shape, 3))
    areas = texel_areas(mesh, sphere, topology, spanned.areas, triangles, barycentrics)
    return Atlas(
        mesh=mesh,
        texels=TexelMesh(topology, spanned.positions, spanned.normals, areas),
        chart_map=CubeChartMap(sphere),
        triangles=triangles,
        barycentrics=barycentrics,
    )


def _interpolate(
    at_vertices: tuple[Floats, Floats], F: Ints, triangles: Ints, barycentrics: Floats
) -> tuple[Floats, Floats]:
    """Positions and unit normals, [n, 3] at the vertices, at barycentric coordinates in triangles, [k, 3]."""
    (V, vertex_normals), corners = at_vertices, F[triangles]
    begins = np.arange(0, corners.size + 1, 3)
    weights = csr_array((barycentrics.reshape(-1), corners.reshape(-1), begins), (len(corners), len(V)))
    normals = weights @ vertex_normals
    lengths = np.linalg.norm(normals, axis=1)
    cancelled = lengths <= 1e-9  # opposite normals: any corner's will do
    normals[cancelled], lengths[cancelled] = vertex_normals[corners[cancelled, 0]], 1.0
    normals /= lengths[:, None]
    return weights @ V, normals


class SphereAtlas(Atlas):
    """Atlas whose texels lie exactly on a sphere round the origin, with all 48 symmetries of the cube."""

    @property
    def radius(self) -> float:
        """Radius of the sphere [m]."""
        return float(np.linalg.norm(self.mesh.V[0]))

    def project(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Closest points on the sphere itself [m] (not on its triangles) and their directions, each [k, 3]."""
        points = check_points(points)
        length = np.linalg.norm(points, axis=1, keepdims=True)
        if not length.all():
            raise AtlasError("the sphere's centre has no nearest surface point; give a point off the centre")
        return self.radius * (points / length), points / length

    def nearest(self, points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Closest points on the sphere [m], [k, 3], and the flat index of the texel in which each lies, [k]."""
        closest, directions = self.project(points)
        return closest, nearest_places(self.places, directions)[1]

    @functools.cached_property
    def places(self) -> Ball:
        """The sphere itself."""
        return Ball(self.radius, self.resolution)


@checked(AtlasError, radius=POSITIVE)
def sphere_atlas(radius: float = 1.0, resolution: int = 128) -> SphereAtlas:
    """Atlas of the sphere of a given radius [m] round the origin, texel positions exact to round-off.

    Its mesh has the texel centres as vertices.

    Raises
    ------
    AtlasError
        If the radius is not positive and finite, the resolution is invalid, or the atlas cannot fit into memory.
    """
    resolution = check_resolution(resolution)
    check_memory(resolution)
    directions, topology = texel_directions(resolution), cube_topology(resolution)
    F, triangles, barycentrics = _texel_triangulation(topology.halo, resolution)
    return SphereAtlas(
        mesh=Mesh(V=radius * directions.reshape(-1, 3), F=F),
        texels=TexelMesh.of(topology, radius * directions, normals=directions),
        chart_map=CubeChartMap(directions.reshape(-1, 3)),
        triangles=triangles,
        barycentrics=barycentrics,
    )


def _texel_triangulation(
    halo: NDArray[np.int64], n: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Triangles of the texel mesh; for each texel, one triangle [6, N, N] and the corner of it [6, N, N, 3] it is."""
    sw, se, nw, ne = halo[:, :-1, :-1], halo[:, :-1, 1:], halo[:, 1:, :-1], halo[:, 1:, 1:]
    # a cell across a cube edge appears on two charts, one at a cube corner on three: it belongs to its lowest texel
    cells = np.stack([sw, se, ne, nw], axis=-1).reshape(-1, 4)
    owner = np.repeat(np.arange(6), (n + 1) ** 2)
    lowest = np.where(cells < 0, np.iinfo(np.int64).max, cells).min(axis=1)
    cells = cells[owner == lowest // (n * n)]
    whole = (cells >= 0).all(axis=1)
    corner_cells = cells[~whole]
    corners = np.array([cell[cell >= 0] for cell in corner_cells]).reshape(-1, 3)
    F = np.concatenate([cells[whole][:, [0, 1, 2]], cells[whole][:, [0, 2, 3]], corners])
    triangles = np.empty(6 * n * n, dtype=np.int64)
    barycentrics = np.zeros((6 * n * n, 3))
    place = np.empty(6 * n * n, dtype=np.int64)
    triangles[F[::-1].ravel()] = np.repeat(np.arange(len(F))[::-1], 3)
    for k in range(3):
        here = F[triangles, k] == np.arange(6 * n * n)
        place[here] = k
    barycentrics[np.arange(6 * n * n), place] = 1.0
    return F, triangles.reshape(6, n, n), barycentrics.reshape(6, n, n, 3)
