"""Area of the surface that belongs to each texel, from the sphere map: see `texels.areas`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...mesh.mesh import Mesh
from ...texels.areas import levelled_areas
from ...texels.topology import TexelTopology


def texel_areas(
    mesh: Mesh,
    sphere: NDArray[np.float64],
    topology: TexelTopology,
    spanned: NDArray[np.float64],
    triangles: NDArray[np.int64],
    barycentrics: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Area of the surface that belongs to each texel [m^2], [6, N, N].

    Parameters
    ----------
    mesh, sphere, topology
        Surface, its sphere map [vertex_count, 3], and the cube's charts.
    spanned : float64 [6, N, N]
        Area that the texel mesh spans [m^2]; see `lumped_areas`.
    triangles, barycentrics
        Where the texels lie; see `Atlas`.
    """
    return levelled_areas(topology, spanned, _sampled_areas(mesh, sphere, triangles, barycentrics))


def solid_angles(resolution: int) -> NDArray[np.float64]:
    """Solid angle of every texel of a chart [sr], [N, N]; the six charts sum to 4 pi."""
    edge = np.tan(np.pi / 4 * (2 * np.arange(resolution + 1) / resolution - 1))
    a, b = edge[None, :], edge[:, None]
    corner = np.arctan(a * b / np.sqrt(1 + a * a + b * b))
    return np.diff(np.diff(corner, axis=0), axis=1)


def _sampled_areas(
    mesh: Mesh, sphere: NDArray[np.float64], triangles: NDArray[np.int64], barycentrics: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Solid angle of each texel times the real area for each unit of it at the texel's centre [m^2], [6, N, N].

    That is 2 A |P|^3 / det(a, b, c) in a triangle of area A that is (a, b, c) on the sphere, where the texel's ray
    meets its chord plane in P.
    """
    corners = sphere[mesh.F]
    meeting = np.einsum("...k,...kj->...j", barycentrics, corners[triangles])
    real = 2 * mesh.triangle_areas / np.linalg.det(corners)
    return solid_angles(triangles.shape[1]) * real[triangles] * np.linalg.norm(meeting, axis=-1) ** 3
