"""The analytic atlas of a sphere: the reference on which symmetry and accuracy are tested."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...checked import POSITIVE, checked
from ...errors import AtlasError
from ...mesh.mesh import Mesh
from ...texels.atlas import Atlas, check_points
from ...texels.nearest import nearest_places
from ...texels.texel_mesh import TexelMesh
from .convention import check_memory, check_resolution, cube_topology, texel_directions
from .cube_chart_map import CubeChartMap
from .nearest import Ball


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
