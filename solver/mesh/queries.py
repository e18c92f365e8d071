"""Queries of triangles: ray hits, see `rays`, and nearest points by libigl."""

from __future__ import annotations

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..kernel import Floats, Floats32, Ints
from .points import check_points
from .rays import make_rays


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
        if F is None:
            V = V.reshape(-1, 3)
            F = np.arange(len(V)).reshape(-1, 3)
        self._rays = make_rays(V, F)

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
        return self._rays.cast(origins, directions)

    def distances(self, origins: NDArray, directions: NDArray) -> Floats32:
        """The distances of `cast` alone, in less time."""
        return self._rays.distances(origins, directions)


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
