"""From linear radiance to a frame's colours, in NumPy, as glsl/tone_mapping.glsl has it for shaders; the sRGB curve."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# The sRGB transfer curve (IEC 61966-2-1): SLOPE x up to BREAK, and (1 + OFFSET) x^(1 / EXPONENT) -
# OFFSET above it.
_BREAK = 0.0031308
_SLOPE = 12.92
_OFFSET = 0.055
_EXPONENT = 2.4
_ENCODED_BREAK = 0.04045
_SHOULDER = 0.72  # radiance from which on brightness rolls off
_BLEACHING = 0.18  # how fast what is brighter turns white

# the same numbers for shaders
CURVES = {
    "SRGB_BREAK": _BREAK,
    "SRGB_SLOPE": _SLOPE,
    "SRGB_OFFSET": _OFFSET,
    "SRGB_EXPONENT": _EXPONENT,
    "SHOULDER": _SHOULDER,
    "BLEACHING": _BLEACHING,
}


def srgb_to_linear(srgb: ArrayLike) -> NDArray[np.float64]:
    """Linear values of sRGB values, 0 to 1 both, any shape."""
    value = np.asarray(srgb, dtype=np.float64)
    above = np.maximum(value, _ENCODED_BREAK)
    return np.where(
        value <= _ENCODED_BREAK, value / _SLOPE, ((above + _OFFSET) / (1 + _OFFSET)) ** _EXPONENT
    )


def linear_to_srgb(linear: ArrayLike) -> NDArray[np.float64]:
    """Inverse of `srgb_to_linear`; values beyond 0 to 1 continue the curve."""
    value = np.asarray(linear, dtype=np.float64)
    above = np.maximum(value, _BREAK)
    return np.where(
        value <= _BREAK, _SLOPE * value, (1 + _OFFSET) * above ** (1 / _EXPONENT) - _OFFSET
    )


def tone_mapped(radiance: ArrayLike) -> NDArray[np.float64]:
    """SRGB colours, 0 to 1, of linear radiance [..., 3]: bright ones roll off to white, others keep their contrast."""
    color = np.maximum(np.asarray(radiance, dtype=np.float64), 0.0)
    peak = color.max(axis=-1, keepdims=True)
    excess = np.maximum(peak - _SHOULDER, 0.0)
    compressed = np.minimum(peak, _SHOULDER) + (1 - _SHOULDER) * excess / (excess + 1 - _SHOULDER)
    color = color * (compressed / np.maximum(peak, 1e-4))
    return linear_to_srgb(color + (compressed - color) * (1 - 1 / (1 + _BLEACHING * excess)))
