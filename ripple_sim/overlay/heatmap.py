"""Heatmaps: a scalar field on the texels, prepared for the renderer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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
