"""The symmetries of the cube, and how they move fields on its charts."""

import functools

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.layouts.cube import CHART_NORMALS, cube_chart_points, texel_directions


@functools.lru_cache(maxsize=1)
def cube_rotations() -> NDArray[np.float64]:
    """The 24 rotations that map the cube onto itself, shape [24, 3, 3]."""
    rotations = []
    for first in range(6):
        for second in range(6):
            x = CHART_NORMALS[first]
            y = CHART_NORMALS[second]
            if x @ y == 0:
                rotations.append(np.stack([x, y, np.cross(x, y)], axis=1))
    return np.array(rotations, dtype=np.float64)


def permute_texels(field: NDArray, transform: NDArray[np.float64]) -> NDArray:
    """Move a field [6, N, N, ...] by one of the cube's 48 symmetries.

    `transform` is a signed permutation matrix [3, 3]. The result r satisfies
    r(transform @ d) = field(d) for the texel directions d.
    """
    n = field.shape[1]
    directions = texel_directions(n).reshape(-1, 3)
    chart, row, column = cube_chart_points(directions @ transform.T, n)
    flat = (chart * n + np.rint(row).astype(int)) * n + np.rint(column).astype(int)
    result = np.empty_like(field)
    result.reshape(6 * n * n, *field.shape[3:])[flat] = field.reshape(6 * n * n, *field.shape[3:])
    return result
