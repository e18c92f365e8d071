"""A closed surface round an object that is no surface itself: parts that pass through each other, scans in pieces.

All points at a given distance from the object, by marching cubes (Lorensen and Cline 1987). What cannot be reached from
far away without coming closer than that counts as inside, as in alpha wrapping (Portaneri et al. 2022).
"""

from __future__ import annotations

import dataclasses

import igl
import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError
from .counting import counted
from .distance_grid import distance_grid, filled
from .isosurface import zero_surface
from .mesh import Mesh

# Below, the grid has more than some 20 million nodes; above, little of the object's shape is left.
_SMALLEST, _LARGEST = 0.004, 0.2
# Nodes nearer to the surface than this share of the spacing are moved off it: they would make slivers.
_CLEAR = 0.05


@dataclasses.dataclass(frozen=True, eq=False)
class Wrap:
    """A closed surface round an object, which carries the object's vertices with it.

    Attributes
    ----------
    mesh : Mesh
        The surface: closed, outward, at the distance `offset` from the object; waves run on it.
    wrapped : Mesh
        The object itself.
    triangles : int64 [n]
        The triangle of `mesh` nearest to each of the n vertices of `wrapped`.
    barycentrics : float64 [n, 3]
        Where in that triangle the nearest point lies.
    offset : float
        Distance of the surface from the object [m].
    """

    mesh: Mesh
    wrapped: Mesh
    triangles: NDArray[np.int64]
    barycentrics: NDArray[np.float64]
    offset: float

    def interpolate(self, values: NDArray) -> NDArray:
        """Values at the vertices of `mesh`, [vertex_count, ...], as the vertices of `wrapped` see them, [n, ...]."""
        corners = values[self.mesh.F[self.triangles]]
        return np.einsum("ij,ij...->i...", self.barycentrics, corners)


def wrap(mesh: Mesh, offset: float = 0.015) -> Wrap:
    """Put a closed surface round a mesh.

    Gaps and holes narrower than two offsets are bridged: pieces so near share one surface, and what lies behind them
    counts as inside. From four offsets on pieces get a surface each, and holes stay open.

    Parameters
    ----------
    mesh : Mesh
    offset : float
        Distance of the surface from the object, relative to the object's longest extent. It is also the spacing of the
        grid on which the surface is found: half the offset has about four times the triangles.

    Raises
    ------
    MeshError
        If the offset is not within 0.004 to 0.2.
    """
    if not _SMALLEST <= offset <= _LARGEST:
        raise MeshError(f"the offset of the wrap is {offset}; valid is {_SMALLEST} to {_LARGEST} of the object's size")
    distance = float(offset * np.ptp(mesh.V, axis=0).max())
    values, origin = distance_grid(mesh.V, mesh.F, distance)
    values = filled(values - distance)
    values = np.where(values < 0, np.minimum(values, -_CLEAR * distance), np.maximum(values, _CLEAR * distance))
    V, F = zero_surface(values, origin, distance)
    found = Mesh.from_arrays(V, F, name=mesh.name)
    note = (
        f"wrapped, {distance:.3g} m off: {counted(mesh.component_count, 'part')} in "
        f"{counted(found.component_count, 'closed surface')} with {counted(int(found.genus.sum()), 'handle')}, "
        f"{counted(len(found.F), 'triangle')}"
    )
    surface = dataclasses.replace(found, notes=(*mesh.notes, note))
    return Wrap(surface, mesh, *_nearest(surface, mesh.V), distance)


def _nearest(mesh: Mesh, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Triangle and barycentric coordinates of the nearest point of a mesh to each of some points."""
    tree = igl.AABB()
    tree.init(mesh.V, mesh.F)
    _, triangle, nearest = tree.squared_distance(mesh.V, mesh.F, points)
    a, b, c = (np.ascontiguousarray(mesh.V[mesh.F[triangle, k]]) for k in range(3))
    return triangle, igl.barycentric_coordinates(nearest, a, b, c)
