"""A closed surface round an object that is no surface itself: parts that pass through each other, scans in pieces.

All points at a given distance from the object, by marching cubes (Lorensen and Cline 1987). What
cannot be reached from far away without coming closer than that counts as inside, as in alpha
wrapping (Portaneri et al. 2022). Distances on the grid are computed where they matter.
"""

from __future__ import annotations

import dataclasses

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import MeshError
from .clean import counted
from .mesh import Mesh
from .queries import ClosestPoints

_COARSEST = 16  # spacings along the side of the largest blocks
_MARGIN = 2  # layers of nodes beyond the surface, on all sides

# Corners of a grid cell as `igl.marching_cubes` counts them: along x, y, z.
_CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)

# Below, the grid has more than some 20 million nodes; above, little of the object's shape is left.
_SMALLEST = 0.004
_LARGEST = 0.2

# Nodes nearer to the surface than this share of the spacing are moved off it: they would make
# slivers.
_CLEAR = 0.05


def distance_grid(
    V: NDArray[np.float64], F: NDArray[np.int64], distance: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance from a mesh at the nodes of a grid whose spacing is `distance` too.

    Parameters
    ----------
    V, F : [vertex_count, 3], [triangle_count, 3]
    distance : float
        Where the distance has to be known exactly [m]. Farther than two spacings from there, a node
        may have the distance of its block's middle, which is on the same side.

    Returns
    -------
    values : float64 [x, y, z]
        Distances [m].
    origin : [3]
        Place of the first node [m]; the outermost ones are farther from the mesh than `distance`.
    """
    closest_points = ClosestPoints(V, F)
    low = V.min(axis=0)
    high = V.max(axis=0)
    origin = low - (1 + _MARGIN) * distance
    shape = np.ceil((high - low) / distance).astype(int) + 3 + 2 * _MARGIN
    blocks = -(-shape // _COARSEST)
    values = np.empty(blocks * _COARSEST)
    corners = _COARSEST * np.indices(blocks).reshape(3, -1).T
    size = _COARSEST
    while True:
        # of the blocks' middles
        found = closest_points.distances(origin + distance * (corners + (size - 1) / 2))
        places = corners[:, None] + np.indices([size] * 3).reshape(3, -1).T
        values[tuple(np.moveaxis(places, -1, 0))] = found[:, None]
        if size == 1:
            return values, origin
        near = np.abs(found - distance) <= (2 + (size - 1) / 2 * np.sqrt(3)) * distance
        size //= 2
        corners = (corners[near][:, None] + size * np.indices([2, 2, 2]).reshape(3, -1).T).reshape(
            -1, 3
        )


def zero_surface(
    values: NDArray[np.float64], origin: ArrayLike, spacing: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangles where values on a grid [x, y, z] change their sign, from those cells alone in which they do."""
    inside = values < 0
    corners = [
        inside[tuple(slice(d, n - 1 + d) for d, n in zip(c, values.shape, strict=True))]
        for c in _CORNERS
    ]
    count = np.sum(corners, axis=0)
    cells = np.argwhere((count > 0) & (count < 8))
    nodes = (cells[:, None] + _CORNERS).reshape(-1, 3)
    used, index = np.unique(np.ravel_multi_index(tuple(nodes.T), values.shape), return_inverse=True)
    points = np.asarray(origin) + np.asarray(spacing) * np.stack(
        np.unravel_index(used, values.shape), axis=1
    )
    return igl.marching_cubes(values.ravel()[used], points, index.reshape(-1, 8), 0.0)[:2]


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
        return np.einsum("ij,ij...->i...", self.barycentrics, values[self.mesh.F[self.triangles]])


def wrap(mesh: Mesh, offset: float = 0.015) -> Wrap:
    """Put a closed surface round a mesh.

    Gaps and holes narrower than two offsets are bridged: pieces so near share one surface, and what
    lies behind them counts as inside. From four offsets on pieces get a surface each, and holes
    stay open.

    Parameters
    ----------
    mesh : Mesh
    offset : float
        Distance of the surface from the object, relative to the object's longest extent. It is also
        the spacing of the grid on which the surface is found: half the offset has about four times
        the triangles.

    Raises
    ------
    MeshError
        If the offset is not within 0.004 to 0.2.
    """
    from scipy.ndimage import label  # takes long to import, for what few meshes need

    if not _SMALLEST <= offset <= _LARGEST:
        raise MeshError(
            f"the offset of the wrap is {offset}; valid is {_SMALLEST} to {_LARGEST} of the "
            f"object's size"
        )
    distance = float(offset * np.ptp(mesh.V, axis=0).max())
    values, origin = distance_grid(mesh.V, mesh.F, distance)
    values -= distance
    # what is positive, but shut off from the first node, is inside
    region, _ = label(values > 0)
    values = np.where((values > 0) & (region != region[0, 0, 0]), -values, values)
    values = np.where(
        values < 0, np.minimum(values, -_CLEAR * distance), np.maximum(values, _CLEAR * distance)
    )
    V, F = zero_surface(values, origin, distance)
    found = Mesh.from_arrays(V, F, name=mesh.name)
    note = (
        f"wrapped, {distance:.3g} m off: {counted(mesh.component_count, 'part')} in "
        f"{counted(found.component_count, 'closed surface')} with "
        f"{counted(int(found.genus.sum()), 'handle')}, "
        f"{counted(len(found.F), 'triangle')}"
    )
    surface = dataclasses.replace(found, notes=(*mesh.notes, note))
    triangles, nearest = ClosestPoints(surface.V, surface.F)(mesh.V)
    a, b, c = (np.ascontiguousarray(surface.V[surface.F[triangles, k]]) for k in range(3))
    return Wrap(surface, mesh, triangles, igl.barycentric_coordinates(nearest, a, b, c), distance)
