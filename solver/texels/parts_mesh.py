"""A mesh cut into the parts of a chart map, with vertices that neighbouring parts share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernel import Floats, Ints
from ..mesh.mesh import Mesh
from .chart_map import ChartMap

# Bits of coordinates in which copies of a point agree.
_BITS = 34

# Barycentric coordinates below this count as 0: the point lies on a side.
_ON_SIDE = 1e-9


class PartsMesh(NamedTuple):
    """A mesh cut into parts; neighbours share their vertices.

    Attributes
    ----------
    V : float64 [n, 3]
        [m].
    F : int64 [m, 3]
    triangle : int64 [m]
        Triangle of the mesh in which each part lies.
    barycentrics : float64 [m, 3, 3]
        Where in that triangle the three corners lie.
    coordinates : float64 [m, 3, d]
        Map coordinates of the corners.
    """

    V: Floats
    F: Ints
    triangle: Ints
    barycentrics: Floats
    coordinates: Floats

    def carry(self, corner_values: Floats) -> Floats:
        """Values at the corners of the parts [m, 3, ...], from the triangles' corners.

        The values are linear in each triangle [triangle_count, 3, ...].
        """
        return np.einsum("pij,pj...->pi...", self.barycentrics, corner_values[self.triangle])


def parts_mesh(chart_map: ChartMap, mesh: Mesh) -> PartsMesh:
    """Cut a mesh into the parts of a chart map; the mesh itself where its triangles are whole."""
    triangle, barycentrics, coordinates = chart_map.linear_parts(mesh)
    if len(triangle) == len(mesh.F) and (barycentrics == np.eye(3)).all():
        return PartsMesh(mesh.V, mesh.F, triangle, barycentrics, coordinates)
    points = np.einsum("pij,pjk->pik", barycentrics, mesh.V[mesh.F[triangle]])
    step = np.ldexp(1.0, np.frexp(np.abs(mesh.V).max())[1] - _BITS)
    place = np.rint(points / step).astype(np.int64).reshape(-1, 3)
    # the element of the mesh on which each corner lies: the two ends of an edge, one vertex twice,
    # or a triangle and -1; so sheets that touch have points of their own
    counts = barycentrics > _ON_SIDE
    corners = np.broadcast_to(mesh.F[triangle][:, None], counts.shape)
    inside = counts.all(axis=2)
    lowest_vertex = np.where(counts, corners, len(mesh.V)).min(axis=2)
    highest_vertex = np.where(counts, corners, -1).max(axis=2)
    low = np.where(inside, triangle[:, None], lowest_vertex)
    high = np.where(inside, -1, highest_vertex)
    key = np.column_stack([low.ravel(), high.ravel(), place])
    _, first, number = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return PartsMesh(
        points.reshape(-1, 3)[first], number.reshape(-1, 3), triangle, barycentrics, coordinates
    )
