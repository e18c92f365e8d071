"""Puts a closed surface round an object that is no surface itself.

Such objects are parts that pass through each other, or scans in pieces. The surface has all points
at a given distance from the object; marching cubes find it (Lorensen and Cline 1987). Places that
cannot be reached from far away without coming closer than this distance count as inside, as in
alpha wrapping (Portaneri et al. 2022). Distances on the grid are computed only where they matter.
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

# Spacings of the grid along the side of the largest blocks.
_LARGEST_BLOCK = 16

# Layers of nodes beyond the surface, on all sides.
_MARGIN = 2

# Corners of a grid cell as `igl.marching_cubes` counts them: along x, y, z.
_CORNERS = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)

# Offset relative to the object's size, at least: below, the grid has more than some 20 million
# nodes.
_MIN_OFFSET = 0.004

# Offset relative to the object's size, at most: above, little of the object's shape is left.
_MAX_OFFSET = 0.2

# Least distance of nodes from the surface, in spacings of the grid. Nearer nodes would make slivers
# and are moved off the surface.
_MIN_NODE_DISTANCE = 0.05


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
    blocks = -(-shape // _LARGEST_BLOCK)
    values = np.empty(blocks * _LARGEST_BLOCK)
    corners = _LARGEST_BLOCK * np.indices(blocks).reshape(3, -1).T
    size = _LARGEST_BLOCK
    while True:
        # all nodes of a block get the distance of its middle
        middles = origin + distance * (corners + (size - 1) / 2)
        middle_distances = closest_points.distances(middles)
        nodes = corners[:, None] + np.indices([size] * 3).reshape(3, -1).T
        values[tuple(np.moveaxis(nodes, -1, 0))] = middle_distances[:, None]
        if size == 1:
            return values, origin
        # blocks near the surface are cut into eight
        reach = 2 + (size - 1) / 2 * np.sqrt(3)  # [spacings]
        near = np.abs(middle_distances - distance) <= reach * distance
        size //= 2
        eighths = size * np.indices([2, 2, 2]).reshape(3, -1).T
        corners = (corners[near][:, None] + eighths).reshape(-1, 3)


def zero_surface(
    values: NDArray[np.float64], origin: ArrayLike, spacing: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangles where values on a grid [x, y, z] change their sign.

    Only the cells in which the sign changes are handed to marching cubes.
    """
    inside = values < 0
    nx, ny, nz = values.shape
    corners = [inside[x : nx - 1 + x, y : ny - 1 + y, z : nz - 1 + z] for x, y, z in _CORNERS]
    inside_count = np.sum(corners, axis=0)
    cells = np.argwhere((inside_count > 0) & (inside_count < 8))
    nodes = (cells[:, None] + _CORNERS).reshape(-1, 3)
    flat_nodes = np.ravel_multi_index(tuple(nodes.T), values.shape)
    used, index = np.unique(flat_nodes, return_inverse=True)
    grid_places = np.stack(np.unravel_index(used, values.shape), axis=1)
    points = np.asarray(origin) + np.asarray(spacing) * grid_places
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
        """Values [n, ...] at the vertices of `wrapped`, from values at the vertices of `mesh`.

        `values` is [vertex_count, ...].
        """
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

    if not _MIN_OFFSET <= offset <= _MAX_OFFSET:
        raise MeshError(
            f"the offset of the wrap must be {_MIN_OFFSET} to {_MAX_OFFSET} of the object's "
            f"size, got {offset}"
        )
    distance = float(offset * np.ptp(mesh.V, axis=0).max())  # [m]
    values, origin = distance_grid(mesh.V, mesh.F, distance)
    values -= distance
    # nodes farther off, but shut off from the first node, are inside
    region, _ = label(values > 0)
    shut_off = (values > 0) & (region != region[0, 0, 0])
    values = np.where(shut_off, -values, values)
    clearance = _MIN_NODE_DISTANCE * distance
    values = np.where(values < 0, np.minimum(values, -clearance), np.maximum(values, clearance))
    V, F = zero_surface(values, origin, distance)
    surface = Mesh.from_arrays(V, F, name=mesh.name)
    note = (
        f"wrapped, {distance:.3g} m off: {counted(mesh.component_count, 'part')} in "
        f"{counted(surface.component_count, 'closed surface')} with "
        f"{counted(int(surface.genus.sum()), 'handle')}, "
        f"{counted(len(surface.F), 'triangle')}"
    )
    surface = dataclasses.replace(surface, notes=(*mesh.notes, note))
    triangles, nearest = ClosestPoints(surface.V, surface.F)(mesh.V)
    a, b, c = (np.ascontiguousarray(surface.V[surface.F[triangles, k]]) for k in range(3))
    return Wrap(surface, mesh, triangles, igl.barycentric_coordinates(nearest, a, b, c), distance)
