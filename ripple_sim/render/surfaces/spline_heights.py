"""Heights between the texels on the processor, by the quadratic B-spline of spline.glsl."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.kernel import Floats32, Ints32, kernel
from ripple_sim.solver.texels.texel_atlas import ChartPage


def spline_samples(page: ChartPage, places: NDArray) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Where places [k, 2] on a page of charts [texels] lie between the texels.

    Returns
    -------
    texel : int32 [k, 3]
        Chart, row and column, in a chart with its halo, of the first of the 3 x 3 texels about each place.
    offset : float32 [k, 2]
        How far off the middle one's centre it is [texels].
    """
    chart, row, column = page.locate(places)
    place = np.stack([row, column], axis=1)
    nearest = np.clip(np.floor(place + 0.5), 0, page.resolution - 1)
    return np.column_stack([chart, nearest]).astype(np.int32), (place - nearest).astype(np.float32)


@kernel
def spline_heights(height_map: Floats32, texel: Ints32, offset: Floats32) -> Floats32:
    """Heights [k] of a height map [C, n + 2, n + 2, 4] at offsets [k, 2] in texels [k, 3]; see `spline_samples`."""
    height = np.empty(len(texel), np.float32)
    half, most = np.float32(0.5), np.float32(0.75)
    for i in range(len(texel)):
        # number by number: unpacking rows takes longer than all the rest
        chart, row, column = texel[i, 0], texel[i, 1], texel[i, 2]
        s, t = offset[i, 0], offset[i, 1]
        left, right = half * (half - t) * (half - t), half * (half + t) * (half + t)
        middle = most - t * t
        low, mean, high = height_map[chart, row], height_map[chart, row + 1], height_map[chart, row + 2]
        height[i] = (
            half * (half - s) * (half - s) * _across(low, column, left, middle, right)
            + (most - s * s) * _across(mean, column, left, middle, right)
            + half * (half + s) * (half + s) * _across(high, column, left, middle, right)
        )
    return height


@kernel(inline="always")
def _across(texels: Floats32, column: int, left: np.float32, middle: np.float32, right: np.float32) -> np.float32:
    """Weighted height of three texels of a row [n + 2, 4], from a column on."""
    return left * texels[column, 3] + middle * texels[column + 1, 3] + right * texels[column + 2, 3]
