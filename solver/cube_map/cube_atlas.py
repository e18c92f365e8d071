"""The atlas of a closed genus-0 mesh: rays through the cube map's texels onto its sphere map."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Floats, Ints, kernel
from ripple_sim.solver.mesh.mesh import Mesh
from ripple_sim.solver.texels.atlas import Atlas
from ripple_sim.solver.texels.texel_mesh import TexelMesh

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
    positions, normals = np.empty((len(triangles), 3)), np.empty((len(triangles), 3))
    _interpolate((mesh.V, mesh.vertex_normals), mesh.F, triangles, barycentrics, (positions, normals))
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


@kernel
def _interpolate(
    at_vertices: tuple[Floats, Floats],
    F: Ints,
    triangles: Ints,
    barycentrics: Floats,
    at_texels: tuple[Floats, Floats],
) -> None:
    """Positions and unit normals, [n, 3] at the vertices, at barycentric coordinates in triangles, [k, 3]."""
    (V, vertex_normals), (positions, normals) = at_vertices, at_texels
    for i in range(len(triangles)):
        corners, weights = F[triangles[i]], barycentrics[i]
        square = 0.0
        for k in range(3):
            position = normal = 0.0
            for j in range(3):
                position += weights[j] * V[corners[j], k]
                normal += weights[j] * vertex_normals[corners[j], k]
            positions[i, k], normals[i, k] = position, normal
            square += normal * normal
        length = np.sqrt(square)
        for k in range(3):
            # opposite normals may cancel: any corner's will do
            normals[i, k] = normals[i, k] / length if length > 1e-9 else vertex_normals[corners[0], k]
