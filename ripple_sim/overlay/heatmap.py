"""Heatmaps: a scalar field on the texels, prepared for the renderer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.texels.halo import padded_addresses


def heatmap_texels(field: NDArray[np.float32]) -> NDArray[np.float32]:
    """Give the charts of a field [6, N, N] their halo of neighbours' texels, with the mean of three at the corners.

    Returns float32 [6, N + 2, N + 2], as the renderer takes it: interpolated, it is continuous across charts.
    """
    n = field.shape[1]
    texels = np.zeros((6, n + 2, n + 2), np.float32)
    texels[:, 1:-1, 1:-1] = field
    _, halo, source = padded_addresses(n)
    texels.reshape(-1)[halo] = texels.reshape(-1)[source]
    for row, inner_row in ((0, 1), (-1, -2)):
        for column, inner_column in ((0, 1), (-1, -2)):
            corner = texels[:, inner_row, inner_column] + texels[:, inner_row, column] + texels[:, row, inner_column]
            texels[:, row, column] = corner / 3
    return texels


def magnitude(field: NDArray[np.float32]) -> float:
    """Mean magnitude of a field with halo, weighted by the magnitude itself: how high the waves are.

    The calm surface around a small wave does not count, and the few texels in the dent under a contact count little.
    """
    inside = np.abs(field[:, 1:-1, 1:-1]).ravel()
    total = float(inside.sum(dtype=np.float64))
    return float(np.dot(inside, inside)) / total if total else 0.0


def grid_spacing(resolution: int) -> int:
    """Texels between grid lines: a power of two that leaves 16 to 31 cells along a chart, or one texel per cell."""
    return 1 << max(0, (resolution // 16).bit_length() - 1)
