"""Tone mapping, from linear radiance to a frame's colours, and the sRGB curve, in NumPy.

glsl/tone_mapping.glsl is the same for shaders.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# The sRGB transfer curve (IEC 61966-2-1) of a linear value x: SLOPE x up to BREAK, and
# (1 + OFFSET) x^(1 / EXPONENT) - OFFSET above BREAK.
_BREAK = 0.0031308
_SLOPE = 12.92
_OFFSET = 0.055
_EXPONENT = 2.4

# The sRGB value of BREAK.
_ENCODED_BREAK = 0.04045

# Radiance above which brightness rolls off to white.
_SHOULDER = 0.72

# How fast colours turn white with radiance above the shoulder.
_BLEACHING = 0.18

# Least peak radiance by which colours are divided.
_MIN_PEAK = 1e-4

# The same numbers for shaders, as defines.
CURVES = {
    "SRGB_BREAK": _BREAK,
    "SRGB_SLOPE": _SLOPE,
    "SRGB_OFFSET": _OFFSET,
    "SRGB_EXPONENT": _EXPONENT,
    "SHOULDER": _SHOULDER,
    "BLEACHING": _BLEACHING,
}


def srgb_to_linear(srgb: ArrayLike) -> NDArray[np.float64]:
    """Linear values, 0 to 1, of sRGB values, 0 to 1, of any shape."""
    value = np.asarray(srgb, dtype=np.float64)
    above = np.maximum(value, _ENCODED_BREAK)
    straight = value / _SLOPE
    curved = ((above + _OFFSET) / (1 + _OFFSET)) ** _EXPONENT
    return np.where(value <= _ENCODED_BREAK, straight, curved)


def linear_to_srgb(linear: ArrayLike) -> NDArray[np.float64]:
    """Inverse of `srgb_to_linear`; values outside 0 to 1 continue the curve."""
    value = np.asarray(linear, dtype=np.float64)
    above = np.maximum(value, _BREAK)
    straight = _SLOPE * value
    curved = (1 + _OFFSET) * above ** (1 / _EXPONENT) - _OFFSET
    return np.where(value <= _BREAK, straight, curved)


def tone_mapped(radiance: ArrayLike) -> NDArray[np.float64]:
    """SRGB colours, 0 to 1, of linear radiance [..., 3].

    Radiance above the shoulder rolls off to white; radiance below keeps its contrast.
    """
    color = np.maximum(np.asarray(radiance, dtype=np.float64), 0.0)
    peak = color.max(axis=-1, keepdims=True)
    excess = np.maximum(peak - _SHOULDER, 0.0)
    compressed = np.minimum(peak, _SHOULDER) + (1 - _SHOULDER) * excess / (excess + 1 - _SHOULDER)
    color = color * (compressed / np.maximum(peak, _MIN_PEAK))
    whiteness = 1 - 1 / (1 + _BLEACHING * excess)
    return linear_to_srgb(color + (compressed - color) * whiteness)
