"""The sRGB transfer curve (IEC 61966-2-1), both ways."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# sRGB is SLOPE x up to BREAK, and (1 + OFFSET) x^(1 / EXPONENT) - OFFSET above it
BREAK, SLOPE, OFFSET, EXPONENT = 0.0031308, 12.92, 0.055, 2.4
_ENCODED_BREAK = 0.04045


def srgb_to_linear(srgb: ArrayLike) -> NDArray[np.float64]:
    """Linear values of sRGB values, 0 to 1 both, any shape."""
    value = np.asarray(srgb, dtype=np.float64)
    above = np.maximum(value, _ENCODED_BREAK)
    return np.where(value <= _ENCODED_BREAK, value / SLOPE, ((above + OFFSET) / (1 + OFFSET)) ** EXPONENT)


def linear_to_srgb(linear: ArrayLike) -> NDArray[np.float64]:
    """Inverse of `srgb_to_linear`; values beyond 0 to 1 continue the curve."""
    value = np.asarray(linear, dtype=np.float64)
    above = np.maximum(value, BREAK)
    return np.where(value <= BREAK, SLOPE * value, (1 + OFFSET) * above ** (1 / EXPONENT) - OFFSET)
