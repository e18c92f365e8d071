"""`FilmExposure` averages the finer pixels and the exposures of a frame in linear light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.tone_mapping import linear_to_srgb, srgb_to_linear
from ripple_sim.solver.kernel import Floats32, kernel

# Steps of the table from linear light to sRGB: with so many each of the 256 codes has entries, even
# the darkest.
_TABLE_STEPS = 1 << 14

# Linear light of each sRGB code, 0 to 1.
_LINEAR_OF_CODE = srgb_to_linear(np.arange(256) / 255).astype(np.float32)

# The sRGB code of each step of linear light from 0 to 1.
_CODE_OF_LINEAR = np.rint(255 * linear_to_srgb(np.arange(_TABLE_STEPS + 1) / _TABLE_STEPS)).astype(
    np.uint8
)


class FilmExposure:
    """Averages the images of a frame in linear light, as film does.

    Images are uint8, in sRGB, with a fourth channel for their opacity, by which the colours are
    weighted; or float16, in linear light, with colours already multiplied by their opacity.

    Parameters
    ----------
    factor : int
        Blocks of factor by factor pixels become one.
    exposures : int
        Images that make up a frame.
    """

    def __init__(self, factor: int = 1, exposures: int = 1) -> None:
        self._factor = factor
        self._exposures = exposures
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
        factor = self._factor
        if factor == self._exposures == 1:
            return image
        height, width, channels = image.shape
        if self._count == 0:
            self._light = np.zeros((height // factor, width // factor, 4), np.float32)
        if image.dtype == np.uint8:
            _add_codes(image, factor, _LINEAR_OF_CODE, self._light)
        else:
            blocks = image.reshape(height // factor, factor, width // factor, factor, channels)
            self._light[..., :channels] += blocks.sum(axis=(1, 3), dtype=np.float32)
        self._count = (self._count + 1) % self._exposures
        if self._count:
            return None
        pixels_per_pixel = factor * factor * self._exposures
        if image.dtype != np.uint8:
            return (self._light[..., :channels] / pixels_per_pixel).astype(image.dtype)
        frame = np.empty((*self._light.shape[:2], channels), np.uint8)
        _encode(self._light, pixels_per_pixel, _CODE_OF_LINEAR, frame)
        return frame


@kernel
def _add_codes(image: NDArray[np.uint8], factor: int, linear: Floats32, light: Floats32) -> None:
    """Add the blocks of an image of sRGB codes to the sums `light` [height, width, 4].

    The first three sums are of linear light times opacity, the last one is of opacity.
    """
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
def _encode(light: Floats32, count: int, srgb: NDArray[np.uint8], frame: NDArray[np.uint8]) -> None:
    """Write the means of the sums `light` of `count` values each as sRGB codes.

    The opacity of a frame is straight: colours are not multiplied by it.
    """
    for row in range(light.shape[0]):
        for column in range(light.shape[1]):
            opacity = light[row, column, 3]
            scale = (len(srgb) - 1) / opacity if opacity > 0 else np.float32(0)
            for channel in range(3):
                frame[row, column, channel] = srgb[int(light[row, column, channel] * scale + 0.5)]
            if frame.shape[2] == 4:
                frame[row, column, 3] = int(opacity / count + 0.5)
