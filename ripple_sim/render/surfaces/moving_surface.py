"""A tessellated surface and its height map, wherever its mesh is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.waves.moved_gradients import MovedGradients

from .moving_vertices import Moved, MovingVertices


class MovingSurface:
    """Takes points, normals and height maps along; made when the surface first moves.

    Parameters
    ----------
    atlas : Atlas
        At rest.
    points, directions, normals : [n, 3]
        Of the tessellated surface at rest; see `MovingVertices`.
    """

    def __init__(self, atlas: Atlas, points: NDArray, directions: NDArray, normals: NDArray) -> None:
        self._atlas, self._rest = atlas, (points, directions, normals)
        self._made: tuple[MovedGradients, MovingVertices] | None = None

    def __call__(self, height_map: NDArray[np.float32], V: NDArray[np.float64]) -> tuple[NDArray[np.float32], Moved]:
        """The height map and the points where the vertices of the mesh are at V [vertex_count, 3] [m]."""
        if self._made is None:
            mesh = self._atlas.mesh
            self._made = MovedGradients(self._atlas), MovingVertices(mesh.V, mesh.F, *self._rest)
        gradients, vertices = self._made
        return gradients(height_map, V), vertices(V)
