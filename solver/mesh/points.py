"""Points as a user gives them: any array of numbers, checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import AtlasError, shown

# Greatest coordinate of a point [m]: squares of a greater one overflow on the way to the nearest
# surface point.
_FARTHEST = 1e100


def check_points(points: ArrayLike) -> NDArray[np.float64]:
    """Points as float64 [k, 3], or `AtlasError`."""
    try:
        array = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise AtlasError(
            f"points must be numbers of shape [3] or [k, 3], in metres, got {shown(points)}"
        ) from error
    if array.ndim == 0 or array.shape[-1] != 3 or array.ndim > 2:
        raise AtlasError(f"points must have shape [3] or [k, 3], in metres, got {array.shape}")
    if not (np.abs(array) < _FARTHEST).all():
        raise AtlasError(
            f"points must be finite coordinates in metres, got NaN or numbers beyond {_FARTHEST:g}"
        )
    return np.ascontiguousarray(array.reshape(-1, 3))
