"""How thick an object is at each texel of its surface."""

from __future__ import annotations

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ..mesh.mesh import Mesh
from .atlas import Atlas
from .smoothing import smoothed

# Over the longest extent: a ray starts so far below the surface, no radius is less than the second or more than the
# third.
_START, _LEAST, _MOST = 1e-3, 0.01, 0.55


def half_thickness(atlas: Atlas) -> NDArray[np.float64]:
    """Half the way from each texel to the other side of the object [m], [C, n, n]: the radius of a ball, of a tube.

    Along the inward normal (Shapira, Shamir and Cohen-Or 2008, "Consistent mesh partitioning and skeletonisation using
    the shape diameter function", with one ray a texel instead of a cone), and smoothed. Without another side it is
    about half of the longest extent.
    """
    radius = half_thickness_at(atlas.mesh, atlas.positions.reshape(-1, 3), atlas.normals.reshape(-1, 3))
    return 1 / smoothed(atlas.texels.topology, 1 / radius.reshape(atlas.areas.shape))


def half_thickness_at(mesh: Mesh, points: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Half the way from points of the surface [m], [k, 3], to the other side [m], [k]; normals [k, 3] are outward."""
    V, F = mesh.V, mesh.F
    middle, size = V.mean(axis=0), float(np.ptp(V, axis=0).max())
    scene = EmbreeScene()
    TriangleMesh(scene, np.ascontiguousarray(((V - middle) / size)[F], dtype=np.float32))
    start = (points - middle) / size - _START * normals
    distance = scene.run(start.astype(np.float32), -normals.astype(np.float32), query="DISTANCE")
    return size * np.clip((distance.astype(np.float64) + _START) / 2, _LEAST, _MOST)
