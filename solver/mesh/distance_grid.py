"""Distance from triangles on a regular grid, computed where it matters."""

from __future__ import annotations

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

_COARSEST = 16  # spacings along the side of the largest blocks
_MARGIN = 2  # layers of nodes beyond the surface, on all sides


def distance_grid(
    V: NDArray[np.float64], F: NDArray[np.int64], distance: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance from a mesh at the nodes of a grid whose spacing is `distance` too.

    Parameters
    ----------
    V, F : [vertex_count, 3], [triangle_count, 3]
    distance : float
        Where the distance has to be known exactly [m]. Farther than two spacings from there, a node may have the
        distance of its block's middle, which is on the same side.

    Returns
    -------
    values : float64 [x, y, z]
        Distances [m].
    origin : [3]
        Place of the first node [m]; the outermost ones are farther from the mesh than `distance`.
    """
    tree = igl.AABB()
    tree.init(V, F)
    low, high = V.min(axis=0), V.max(axis=0)
    origin = low - (1 + _MARGIN) * distance
    shape = np.ceil((high - low) / distance).astype(int) + 3 + 2 * _MARGIN
    blocks = -(-shape // _COARSEST)
    values = np.empty(blocks * _COARSEST)
    corners = _COARSEST * np.stack(np.meshgrid(*map(np.arange, blocks), indexing="ij"), axis=-1).reshape(-1, 3)
    size = _COARSEST
    while True:
        middle = origin + distance * (corners + (size - 1) / 2)
        found = np.sqrt(tree.squared_distance(V, F, middle)[0])
        places = corners[:, None] + _block(size)
        values[tuple(np.moveaxis(places, -1, 0))] = found[:, None]
        if size == 1:
            return values, origin
        near = np.abs(found - distance) <= (2 + (size - 1) / 2 * np.sqrt(3)) * distance
        size //= 2
        corners = (corners[near][:, None] + size * _block(2)).reshape(-1, 3)


def filled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values on a grid with what is positive, but shut off from the first node, made negative."""
    region, _ = label(values > 0)
    return np.where((values > 0) & (region != region[0, 0, 0]), -values, values)


def _block(size: int) -> NDArray[np.int64]:
    """Nodes of a cube, [size^3, 3], counted from its first corner."""
    return np.stack(np.meshgrid(*[np.arange(size)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
