"""Queries of triangles: ray hits by Embree (in float32), and nearest points by libigl."""

from __future__ import annotations

import igl
import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import ArrayLike, NDArray

from ..kernel import Floats, Floats32, Ints
from .points import check_points

# Distances beyond this are misses, in lengths of a ray's direction: Embree's distance of a miss is
# 1e37.
_MISS_DISTANCE = 1e36


class ClosestPoints:
    """The nearest points of triangles, by a tree of boxes.

    Parameters
    ----------
    V : float64 [n, 3]
    F : int64 [m, 3]
    """

    def __init__(self, V: Floats, F: Ints) -> None:
        self._V = np.ascontiguousarray(V)
        self._F = np.ascontiguousarray(F)
        self._tree = igl.AABB()
        self._tree.init(self._V, self._F)

    def __call__(self, points: ArrayLike) -> tuple[Ints, Floats]:
        """Find the triangle nearest to each point, and the nearest point on it.

        Parameters
        ----------
        points : [k, 3] or [3]
            [m].

        Returns
        -------
        triangles : int64 [k]
        closest : float64 [k, 3]
            [m].

        Raises
        ------
        AtlasError
            If the points are not finite, or not of shape [k, 3] or [3].
        """
        return self.nearest(check_points(points))

    def nearest(self, points: Floats) -> tuple[Ints, Floats]:
        """Like `__call__`, for points [k, 3] that need no check."""
        return self._tree.squared_distance(self._V, self._F, points)[1:]

    def distances(self, points: ArrayLike) -> Floats:
        """Distance from each point [k, 3] to the triangles [m], [k]."""
        return np.sqrt(self._tree.squared_distance(self._V, self._F, check_points(points))[0])


class RayScene:
    """Triangles for rays to meet.

    Parameters
    ----------
    V : [n, 3], or [m, 3, 3] where F is left out
        Vertices, or the corners of all triangles.
    F : [m, 3], optional
    """

    def __init__(self, V: NDArray, F: NDArray | None = None) -> None:
        self._scene = EmbreeScene()
        indices = () if F is None else (np.ascontiguousarray(F, dtype=np.int32),)
        TriangleMesh(self._scene, np.ascontiguousarray(V, dtype=np.float32), *indices)

    def cast(
        self, origins: NDArray, directions: NDArray
    ) -> tuple[Ints, Floats32, Floats32, Floats32]:
        """First hits of rays from origins [k, 3] along directions [k, 3].

        Returns
        -------
        triangle : int64 [k]
            -1 for a miss.
        distance : float32 [k]
            In lengths of the direction; infinite for a miss.
        u, v : float32 [k]
            Barycentric coordinates of the triangle's second and third corner.
        """
        hits = self._scene.run(_float32(origins), _float32(directions), output=1)
        triangle = np.asarray(hits["primID"], dtype=np.int64)
        distance = np.where(triangle >= 0, hits["tfar"], np.float32(np.inf))
        return triangle, distance, hits["u"], hits["v"]

    def distances(self, origins: NDArray, directions: NDArray) -> Floats32:
        """The distances of `cast` alone, in less time."""
        distances = self._scene.run(_float32(origins), _float32(directions), query="DISTANCE")
        return np.where(distances < _MISS_DISTANCE, distances, np.float32(np.inf))


def _float32(vectors: NDArray) -> Floats32:
    return np.ascontiguousarray(vectors, dtype=np.float32)


def downward_hits(
    scene: RayScene, xy: NDArray[np.float64], top: float
) -> tuple[Ints, NDArray[np.float64]]:
    """First hits of vertical rays from above at xy [k, 2].

    Returns the triangle [k], -1 for none, and the height of the hit [m] [k], NaN for none.

    Nothing is higher than `top` [m].
    """
    start = top + 0.1 * (1 + abs(top))
    starts = np.column_stack([xy, np.full(len(xy), start)])
    down = np.tile([0.0, 0.0, -1.0], (len(xy), 1))
    triangle, distance, _, _ = scene.cast(starts, down)
    return triangle, np.where(triangle >= 0, start - distance, np.nan)
