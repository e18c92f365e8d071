"""Rays that meet triangles: by Embree, or by libigl where Embree has no wheel (Linux on ARM)."""

from __future__ import annotations

from typing import Protocol

import igl
import numpy as np
from numpy.typing import NDArray

try:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene
except ImportError:
    EmbreeScene = None

from ..kernel import Floats, Floats32, Ints

# Distances beyond this are misses, in lengths of a ray's direction: Embree's distance of a miss is
# 1e37.
_MISS_DISTANCE = 1e36

Hits = tuple[Ints, Floats32, Floats32, Floats32]


class Rays(Protocol):
    """Triangles that answer for rays from origins [k, 3] along directions [k, 3]."""

    def cast(self, origins: NDArray, directions: NDArray) -> Hits:
        """First hits: triangle [k], distance [k], and barycentric u and v [k]."""

    def distances(self, origins: NDArray, directions: NDArray) -> Floats32:
        """Distances of the first hits [k], infinite for a miss."""


class EmbreeRays:
    """Rays by Embree, in float32.

    Parameters
    ----------
    V : [n, 3]
    F : [m, 3]
    """

    def __init__(self, V: NDArray, F: NDArray) -> None:
        self._scene = EmbreeScene()
        vertices = np.ascontiguousarray(V, dtype=np.float32)
        TriangleMesh(self._scene, vertices, np.ascontiguousarray(F, dtype=np.int32))

    def cast(self, origins: NDArray, directions: NDArray) -> Hits:
        """First hits, see `Rays`."""
        hits = self._scene.run(_float32(origins), _float32(directions), output=1)
        triangle = np.asarray(hits["primID"], dtype=np.int64)
        distance = np.where(triangle >= 0, hits["tfar"], np.float32(np.inf))
        return triangle, distance, hits["u"], hits["v"]

    def distances(self, origins: NDArray, directions: NDArray) -> Floats32:
        """Distances of the first hits, see `Rays`."""
        distances = self._scene.run(_float32(origins), _float32(directions), query="DISTANCE")
        return np.where(distances < _MISS_DISTANCE, distances, np.float32(np.inf))


class TreeRays:
    """Rays by libigl's tree of boxes, in float64; some times slower than Embree.

    Parameters
    ----------
    V : [n, 3]
    F : [m, 3]
    """

    def __init__(self, V: NDArray, F: NDArray) -> None:
        self._V = np.ascontiguousarray(V, dtype=np.float64)
        self._F = np.ascontiguousarray(F, dtype=np.int64)
        self._tree = igl.AABB()
        self._tree.init(self._V, self._F)

    def cast(self, origins: NDArray, directions: NDArray) -> Hits:
        """First hits, see `Rays`."""
        triangle, distance, uv = self._tree.intersect_ray_first(
            self._V, self._F, _float64(origins), _float64(directions)
        )
        distance = np.where(triangle >= 0, distance, np.inf).astype(np.float32)
        u, v = uv.astype(np.float32).T
        return triangle, distance, u, v

    def distances(self, origins: NDArray, directions: NDArray) -> Floats32:
        """Distances of the first hits, see `Rays`."""
        return self.cast(origins, directions)[1]


def make_rays(V: NDArray, F: NDArray) -> Rays:
    """The faster way that this machine has."""
    return TreeRays(V, F) if EmbreeScene is None else EmbreeRays(V, F)


def _float32(vectors: NDArray) -> Floats32:
    return np.ascontiguousarray(vectors, dtype=np.float32)


def _float64(vectors: NDArray) -> Floats:
    return np.ascontiguousarray(vectors, dtype=np.float64)
