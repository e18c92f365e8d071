"""A scalar field on the texels, made ready to be shown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.texels.halo import padded_addresses


def heatmap_texels(field: NDArray[np.float32]) -> NDArray[np.float32]:
    """Surround the faces of a field [6, N, N] by their neighbours' texels, and the mean of three at the corners.

    Returns float32 [6, N + 2, N + 2], as the renderer takes it: interpolated, it is continuous all over the cube.
    """
    n = field.shape[1]
    padded = np.zeros((6, n + 2, n + 2), np.float32)
    padded[:, 1:-1, 1:-1] = field
    _, ring, source = padded_addresses(n)
    padded.reshape(-1)[ring] = padded.reshape(-1)[source]
    for row, inner_row in ((0, 1), (-1, -2)):
        for column, inner_column in ((0, 1), (-1, -2)):
            corner = padded[:, inner_row, inner_column] + padded[:, inner_row, column] + padded[:, row, inner_column]
            padded[:, row, column] = corner / 3
    return padded


def magnitude(field: NDArray[np.float32]) -> float:
    """Mean magnitude of a padded field, each value with its own magnitude as weight: how high waves are where they are.

    A calm surface round the first small ring does not count, nor do a few texels in the dent under a contact for much.
    """
    inside = np.abs(field[:, 1:-1, 1:-1]).ravel()
    total = float(inside.sum(dtype=np.float64))
    return float(np.dot(inside, inside)) / total if total else 0.0


def grid_spacing(resolution: int) -> int:
    """Texels between the lines of a grid: a power of two that leaves 16 to 31 cells along a face, or all there are."""
    return 1 << max(0, (resolution // 16).bit_length() - 1)
