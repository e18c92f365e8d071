"""What is asked of triangles: which of them rays meet, by Embree in float32, and their nearest points, by libigl."""

from __future__ import annotations

import igl
import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from ..kernel import Floats, Floats32, Ints

_FAR = 1e36  # Embree's distance of nothing is 1e37


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

    def __call__(self, points: Floats) -> tuple[Ints, Floats]:
        """Triangle nearest to each of some points [k, 3], [k], and the point nearest on it, [k, 3]."""
        return self._tree.squared_distance(self._V, self._F, points)[1:]

    def distances(self, points: Floats) -> Floats:
        """How far those points are from the triangles, [k]."""
        return np.sqrt(self._tree.squared_distance(self._V, self._F, points)[0])


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
        """What rays from origins [k, 3] along directions [k, 3] meet first.

        The triangle of each, -1 for none; the distance, in lengths of the direction, infinite for
        none; and barycentric coordinates of the triangle's second and third corner; each [k].
        """
        found = self._scene.run(_float32(origins), _float32(directions), output=1)
        triangle = np.asarray(found["primID"], dtype=np.int64)
        return (
            triangle,
            np.where(triangle >= 0, found["tfar"], np.float32(np.inf)),
            found["u"],
            found["v"],
        )

    def distances(self, origins: NDArray, directions: NDArray) -> Floats32:
        """How far rays go, as `cast` says, in less time."""
        found = self._scene.run(_float32(origins), _float32(directions), query="DISTANCE")
        return np.where(found < _FAR, found, np.float32(np.inf))


def _float32(vectors: NDArray) -> Floats32:
    return np.ascontiguousarray(vectors, dtype=np.float32)


def downward_hits(
    scene: RayScene, xy: NDArray[np.float64], top: float
) -> tuple[Ints, NDArray[np.float64]]:
    """What vertical rays from above at xy [k, 2] first meet, each [k]: the triangle, and its height [m]; -1 and NaN.

    Nothing is higher than `top` [m].
    """
    start = top + 0.1 * (1 + abs(top))
    starts = np.column_stack([xy, np.full(len(xy), start)])
    down = np.tile([0.0, 0.0, -1.0], (len(xy), 1))
    triangle, distance, _, _ = scene.cast(starts, down)
    return triangle, np.where(triangle >= 0, start - distance, np.nan)
