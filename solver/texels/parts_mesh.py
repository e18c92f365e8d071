"""The parts of a mesh's triangles on which map coordinates are linear, as a mesh of their own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..mesh.mesh import Mesh
from .chart_map import ChartMap

_BITS = 34  # of coordinates in which copies of a point agree
_ON_SIDE = 1e-9  # barycentric coordinates below it count as 0


class PartsMesh(NamedTuple):
    """A mesh cut into parts; neighbours share their vertices.

    Attributes
    ----------
    V : float64 [n, 3]
        [m].
    F : int64 [m, 3]
    triangle : int64 [m]
        Triangle of the mesh in which each lies.
    barycentrics : float64 [m, 3, 3]
        Where in it, of the three corners.
    coordinates : float64 [m, 3, d]
        Map coordinates of the corners.
    """

    V: NDArray[np.float64]
    F: NDArray[np.int64]
    triangle: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    coordinates: NDArray[np.float64]

    def carry(self, corner_values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at the parts' corners [m, 3, ...] of what is linear in each triangle [triangle_count, 3, ...]."""
        return np.einsum("pij,pj...->pi...", self.barycentrics, corner_values[self.triangle])


def parts_mesh(chart_map: ChartMap, mesh: Mesh) -> PartsMesh:
    """Cut a mesh into the parts of a chart map; the mesh itself where its triangles are whole."""
    triangle, barycentrics, coordinates = chart_map.linear_parts(mesh)
    if len(triangle) == len(mesh.F) and (barycentrics == np.eye(3)).all():
        return PartsMesh(mesh.V, mesh.F, triangle, barycentrics, coordinates)
    points = np.einsum("pij,pjk->pik", barycentrics, mesh.V[mesh.F[triangle]])
    step = np.ldexp(1.0, np.frexp(np.abs(mesh.V).max())[1] - _BITS)
    place = np.rint(points / step).astype(np.int64).reshape(-1, 3)
    key = np.column_stack([_owners(mesh, triangle, barycentrics).reshape(-1, 2), place])
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return PartsMesh(points.reshape(-1, 3)[first], number.reshape(-1, 3), triangle, barycentrics, coordinates)


def _owners(mesh: Mesh, triangle: NDArray[np.int64], barycentrics: NDArray[np.float64]) -> NDArray[np.int64]:
    """What of the mesh each corner lies on [p, 3, 2]: the ends of an edge, one vertex twice, or a triangle and -1.

    Sheets that touch have points of their own.
    """
    corners = np.broadcast_to(mesh.F[triangle][:, None], barycentrics.shape)
    held = barycentrics > _ON_SIDE
    low = np.where(held, corners, len(mesh.V)).min(axis=2)
    high = np.where(held, corners, -1).max(axis=2)
    inside = held.all(axis=2)
    return np.stack([np.where(inside, triangle[:, None], low), np.where(inside, -1, high)], axis=2)
