"""Heights between the texels of a height map, by a quadratic B-spline.

glsl/height_maps.glsl interpolates them in the same way on the GPU.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Floats32, Ints32, kernel


def spline_samples(
    chart: NDArray, row: NDArray, column: NDArray, resolution: int
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """The 3 x 3 texels about places on charts, [k] each, and how far the places are off the middle.

    Returns
    -------
    texel : int32 [k, 3]
        Chart, row and column, in a chart with its halo, of the first of the 3 x 3 texels.
    offset : float32 [k, 2]
        From the centre of the middle texel to the place, in rows and columns [texels].
    """
    place = np.stack([row, column], axis=1)
    nearest = np.clip(np.floor(place + 0.5), 0, resolution - 1)
    return np.column_stack([chart, nearest]).astype(np.int32), (place - nearest).astype(np.float32)


@kernel(inline="always")
def spline_weights(t: np.float32) -> tuple[np.float32, np.float32, np.float32]:
    """Weights of three texels in a row at a place `t` [texels] from the centre of the middle one.

    glsl/height_maps.glsl has the same weights for both axes.
    """
    half = np.float32(0.5)
    return half * (half - t) * (half - t), np.float32(0.75) - t * t, half * (half + t) * (half + t)


@kernel
def spline_heights(height_map: Floats32, texel: Ints32, offset: Floats32) -> Floats32:
    """Heights [k] of a height map [C, n + 2, n + 2, 4] at places given by `spline_samples`."""
    height = np.empty(len(texel), np.float32)
    for i in range(len(texel)):
        # number by number: to unpack a row takes longer than all the rest
        chart = texel[i, 0]
        row = texel[i, 1]
        column = texel[i, 2]
        down = spline_weights(offset[i, 0])
        across = spline_weights(offset[i, 1])
        total = np.float32(0)
        for j in range(3):
            line = height_map[chart, row + j]
            total += down[j] * (
                across[0] * line[column, 3]
                + across[1] * line[column + 1, 3]
                + across[2] * line[column + 2, 3]
            )
        height[i] = total
    return height
