"""The surface of a field on a regular grid, by marching cubes."""

from __future__ import annotations

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray

# Corners of a grid cell as `igl.marching_cubes` counts them: along x, y, z.
_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])


def zero_surface(
    values: NDArray[np.float64], origin: ArrayLike, spacing: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangles where values on a grid [x, y, z] change their sign, from those cells alone in which they do."""
    inside = values < 0
    corners = [inside[tuple(slice(d, n - 1 + d) for d, n in zip(c, values.shape, strict=True))] for c in _CORNERS]
    count = np.sum(corners, axis=0)
    cells = np.argwhere((count > 0) & (count < 8))
    nodes = (cells[:, None] + _CORNERS).reshape(-1, 3)
    number = np.ravel_multi_index(tuple(nodes.T), values.shape)
    used, index = np.unique(number, return_inverse=True)
    places = np.stack(np.unravel_index(used, values.shape), axis=1)
    V, F, _ = igl.marching_cubes(
        values.ravel()[used],
        np.asarray(origin) + np.asarray(spacing) * places,
        index.reshape(-1, 8).astype(np.int64),
        0.0,
    )
    return V, F
