"""Linear radiance to the colours of a frame, as the renderer's shader makes them (render/glsl/tone_mapping.glsl)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_SHOULDER = 0.72  # radiance from which on brightness rolls off
_BLEACHING = 0.18


def tone_mapped(radiance: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Colours, sRGB [height, width, 3], of linear radiance of the same shape."""
    radiance = np.maximum(radiance, 0.0)
    peak = radiance.max(axis=-1, keepdims=True)
    excess = np.maximum(peak - _SHOULDER, 0.0)
    compressed = np.minimum(peak, _SHOULDER) + (1 - _SHOULDER) * excess / (excess + 1 - _SHOULDER)
    color = radiance * (compressed / np.maximum(peak, 1e-4))
    color += (compressed - color) * (1 - 1 / (1 + _BLEACHING * excess))
    coded = np.where(color <= 0.0031308, 12.92 * color, 1.055 * color ** (1 / 2.4) - 0.055)
    return np.rint(255 * np.clip(coded, 0.0, 1.0)).astype(np.uint8)
