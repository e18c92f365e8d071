"""A camera's sensor: averages the finer pixels and the exposures of a frame, in linear light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.color import linear_to_srgb, srgb_to_linear
from ripple_sim.solver.kernel import Floats32, kernel

# Steps of the table from linear light to sRGB: enough that each of the 256 values has entries, the darkest too.
_FINE = 1 << 14
_LINEAR = srgb_to_linear(np.arange(256) / 255).astype(np.float32)
_SRGB = np.rint(255 * linear_to_srgb(np.arange(_FINE + 1) / _FINE)).astype(np.uint8)


class Sensor:
    """Averages images in linear light.

    Images are uint8, in sRGB, with a fourth channel for their opacity, by which the colours are weighted; or float16,
    in linear light, with colours already multiplied by their opacity.

    Parameters
    ----------
    factor : int
        Blocks of factor by factor pixels become one.
    exposures : int
        Images that make up a frame.
    """

    def __init__(self, factor: int = 1, exposures: int = 1) -> None:
        self._factor, self._exposures = factor, exposures
        self._count = 0
        self._light = np.zeros((0, 0, 4), np.float32)  # sums: light times opacity, opacity

    def expose(self, image: NDArray) -> NDArray | None:
        """Take in an image.

        Parameters
        ----------
        image : uint8 or float16 [factor height, factor width, 3 or 4]
            The same shape and kind for all exposures of a frame.

        Returns
        -------
        uint8 or float16 [height, width, 3 or 4]
            The frame after its last exposure; None before.
        """
        if self._factor == self._exposures == 1:
            return image
        factor, (height, width, channels) = self._factor, image.shape
        if self._count == 0:
            self._light = np.zeros((height // factor, width // factor, 4), np.float32)
        if image.dtype == np.uint8:
            _gather_codes(image, factor, _LINEAR, self._light)
        else:
            blocks = image.reshape(height // factor, factor, width // factor, factor, channels)
            self._light[..., :channels] += blocks.sum(axis=(1, 3), dtype=np.float32)
        self._count = (self._count + 1) % self._exposures
        if self._count:
            return None
        most = factor * factor * self._exposures
        if image.dtype != np.uint8:
            return (self._light[..., :channels] / most).astype(image.dtype)
        frame = np.empty((*self._light.shape[:2], channels), np.uint8)
        _encode(self._light, most, _SRGB, frame)
        return frame


@kernel
def _gather_codes(image: NDArray[np.uint8], factor: int, linear: Floats32, light: Floats32) -> None:
    """Add an image's blocks, in linear light, to the sums `light` [height, width, 4]: light times opacity, opacity."""
    opaque = image.shape[2] == 3
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            red = green = blue = opacity = np.float32(0)
            for i in range(factor * row, factor * (row + 1)):
                for j in range(factor * column, factor * (column + 1)):
                    weight = np.float32(1) if opaque else np.float32(image[i, j, 3])
                    red += weight * linear[image[i, j, 0]]
                    green += weight * linear[image[i, j, 1]]
                    blue += weight * linear[image[i, j, 2]]
                    opacity += weight
            light[row, column, 0] += red
            light[row, column, 1] += green
            light[row, column, 2] += blue
            light[row, column, 3] += opacity


@kernel
def _encode(light: Floats32, most: int, srgb: NDArray[np.uint8], frame: NDArray[np.uint8]) -> None:
    """Means of the sums `light` of `most` values each, as sRGB codes with straight opacity."""
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            opacity = light[row, column, 3]
            scale = (len(srgb) - 1) / opacity if opacity > 0 else np.float32(0)
            for channel in range(3):
                frame[row, column, channel] = srgb[int(light[row, column, channel] * scale + 0.5)]
            if frame.shape[2] == 4:
                frame[row, column, 3] = int(opacity / most + 0.5)
