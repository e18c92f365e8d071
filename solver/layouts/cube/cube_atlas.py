"""The atlas of a closed genus-0 mesh: rays through the cube map's texels onto its sphere map."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ...kernel import Floats, Ints
from ...mesh.mesh import Mesh
from ...texels.atlas import Atlas
from ...texels.texel_mesh import TexelMesh
from .areas import texel_areas
from .convention import check_resolution, cube_topology, texel_directions
from .cube_chart_map import CubeChartMap
from .rays import cast_rays

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
