"""Fields between the texels: bilinear interpolation on the cube."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from ripple_sim.solver.texels.cube_map.convention import face_coordinates, padded_indices


def sampling_matrix(directions: NDArray[np.float64], resolution: int) -> csr_array:
    """Matrix that takes a flattened field [6 N^2] to its values in directions [k, 3] from the cube's centre.

    Directions of surface points come from `Atlas.project`. At the cube's corners, where only three texels meet, the
    weights of the fourth are shared out.
    """
    n = resolution
    index = padded_indices(n)
    face, row, column = face_coordinates(directions, n)
    r, c = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
    s, t = row - r, column - c
    texels, weights = [], []
    for i, j, weight in ((0, 0, (1 - s) * (1 - t)), (0, 1, (1 - s) * t), (1, 0, s * (1 - t)), (1, 1, s * t)):
        texel = index[face, r + 1 + i, c + 1 + j]
        texels.append(np.maximum(texel, 0))
        weights.append(np.where(texel < 0, 0, weight))
    share = np.array(weights)
    share /= share.sum(axis=0)
    rows = np.tile(np.arange(len(face)), 4)
    return csr_array((share.ravel(), (rows, np.concatenate(texels))), shape=(len(face), 6 * n * n))
