"""Fields between the texels: bilinear interpolation on charts with halo."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from .topology import TexelTopology


def sampling_matrix(
    topology: TexelTopology, chart: NDArray[np.int64], row: NDArray[np.float64], column: NDArray[np.float64]
) -> csr_array:
    """Matrix that takes a flattened field [C n^2] to its values at chart points, each [k]; see `Atlas.locate`.

    In a corner where other than four charts meet the weight of the texel that is missing is shared out.
    """
    r, c = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
    s, t = row - r, column - c
    texels, weights = [], []
    for i, j, weight in ((0, 0, (1 - s) * (1 - t)), (0, 1, (1 - s) * t), (1, 0, s * (1 - t)), (1, 1, s * t)):
        texel = topology.halo[chart, r + 1 + i, c + 1 + j]
        texels.append(np.maximum(texel, 0))
        weights.append(np.where(texel < 0, 0, weight))
    share = np.array(weights)
    share /= share.sum(axis=0)
    rows = np.tile(np.arange(len(chart)), 4)
    return csr_array((share.ravel(), (rows, np.concatenate(texels))), shape=(len(chart), topology.texel_count))
