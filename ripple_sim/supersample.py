"""Pictures made smaller by averaging what falls on a pixel: in linear light, as a camera's sensor does it."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

# sRGB, IEC 61966-2-1. Fine enough that every one of the 256 values has entries of its own, also the darkest.
_FINE = 1 << 14
_CODES = np.arange(256) / 255
_LINEAR = np.where(_CODES <= 0.04045, _CODES / 12.92, ((_CODES + 0.055) / 1.055) ** 2.4).astype(np.float32)
_LIGHT = np.arange(_FINE + 1) / _FINE
_SRGB = np.rint(255 * np.where(_LIGHT <= 0.0031308, 12.92 * _LIGHT, 1.055 * _LIGHT ** (1 / 2.4) - 0.055)).astype(
    np.uint8
)


def shrink(frame: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    """Average blocks of `factor` x `factor` pixels.

    Parameters
    ----------
    frame : uint8 [factor height, factor width, 3 or 4]
        sRGB, and opacity, by which the colours are then weighted.
    factor : int

    Returns
    -------
    uint8 [height, width, 3 or 4]
    """
    if factor == 1:
        return frame
    height, width, channels = frame.shape
    small = np.empty((height // factor, width // factor, channels), np.uint8)
    _average(frame, factor, _LINEAR, _SRGB, small)
    return small


@numba.njit(cache=True, nogil=True)
def _average(frame, factor, linear, srgb, small):
    opaque = frame.shape[2] == 3
    for row in range(small.shape[0]):
        for column in range(small.shape[1]):
            red = green = blue = opacity = np.float32(0)
            for i in range(factor * row, factor * (row + 1)):
                for j in range(factor * column, factor * (column + 1)):
                    weight = np.float32(1) if opaque else np.float32(frame[i, j, 3])
                    red += weight * linear[frame[i, j, 0]]
                    green += weight * linear[frame[i, j, 1]]
                    blue += weight * linear[frame[i, j, 2]]
                    opacity += weight
            scale = (len(srgb) - 1) / opacity if opacity > 0 else np.float32(0)
            small[row, column, 0] = srgb[int(red * scale + 0.5)]
            small[row, column, 1] = srgb[int(green * scale + 0.5)]
            small[row, column, 2] = srgb[int(blue * scale + 0.5)]
            if not opaque:
                small[row, column, 3] = int(opacity / (factor * factor) + 0.5)
