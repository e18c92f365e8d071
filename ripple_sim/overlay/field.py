"""A scalar field on the texels, made ready to be shown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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
