"""A tessellated surface and its height map, wherever its mesh is."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver import Atlas
from ripple_sim.solver.waves.motion import MovedGradients

from .moving import Moved, MovingVertices


class MovingSurface:
    """Takes points, normals and height maps along; what that takes is made when the surface first moves.

    Parameters
    ----------
    atlas : Atlas
        At rest.
    points, directions, normals : [n, 3]
        Of the tessellated surface at rest; see `MovingVertices`.
    """

    def __init__(self, atlas: Atlas, points: NDArray, directions: NDArray, normals: NDArray) -> None:
        self._atlas, self._rest = atlas, (points, directions, normals)

    @functools.cached_property
    def vertices(self) -> MovingVertices:
        """How the points ride on the mesh."""
        mesh = self._atlas.mesh
        return MovingVertices(mesh.V, mesh.F, *self._rest)

    @functools.cached_property
    def _gradients(self) -> MovedGradients:
        return MovedGradients(self._atlas)

    def __call__(self, height_map: NDArray[np.float32], V: NDArray[np.float64]) -> tuple[NDArray[np.float32], Moved]:
        """The height map and the points where the vertices of the mesh are at V [vertex_count, 3] [m]."""
        return self._gradients(height_map, V), self.vertices(V)
