"""Pixels of materials: linear light, factors, opacity, and images beyond their edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.render.tone_mapping import linear_to_srgb, srgb_to_linear
from ripple_sim.solver.mesh.looks import BLEND, CLAMP, MASK, MIRROR, Looks, Paint


def wrapped(index: NDArray[np.int64], size: int, mode: str) -> NDArray[np.int64]:
    """Pixels of an image that are seen at places within it and beyond."""
    if mode == CLAMP:
        return np.clip(index, 0, size - 1)
    if mode == MIRROR:
        place = index % (2 * size)
        return np.minimum(place, 2 * size - 1 - place)
    return index % size


def scaled(image: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    """An image with both sides scaled, at least one pixel each."""
    height, width = image.shape[:2]
    return resized(image, (max(1, round(scale * width)), max(1, round(scale * height))))


def resized(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """An image of another size (width, height)."""
    if size == image.shape[1::-1]:
        return image
    smaller = size[0] <= image.shape[1] and size[1] <= image.shape[0]
    filtering = Image.Resampling.BOX if smaller else Image.Resampling.BILINEAR
    return np.asarray(Image.fromarray(image).resize(size, filtering))


def sampled(
    image: NDArray[np.float64], at: NDArray[np.float64], wrap: tuple[str, str]
) -> NDArray[np.float64]:
    """Linear interpolation between the pixels of an image at places [..., 2]."""
    height, width = image.shape[:2]
    low = np.floor(at - 0.5)
    share = at - 0.5 - low
    column, row = np.moveaxis(low.astype(np.int64), -1, 0)
    columns = [wrapped(column + k, width, wrap[0]) for k in (0, 1)]
    rows = [wrapped(row + k, height, wrap[1]) for k in (0, 1)]
    across, down = np.moveaxis(share, -1, 0)[..., None]
    upper = image[rows[0], columns[0]] * (1 - across) + image[rows[0], columns[1]] * across
    lower = image[rows[1], columns[0]] * (1 - across) + image[rows[1], columns[1]] * across
    return upper * (1 - down) + lower * down


def tinted(image: NDArray[np.uint8], paint: Paint) -> NDArray[np.uint8]:
    """An image times the colour of a material."""
    factor = factor_of(paint)
    pixels = image.copy()
    pixels[..., 3] = _opacity(image[..., 3] / 255 * factor[3], paint)
    if (factor[:3] == 1).all():
        return pixels
    # each channel has 256 values: a table is exact and fast
    table = _encode(srgb_to_linear(np.arange(256) / 255)[:, None] * factor[:3])
    for channel in range(3):
        pixels[..., channel] = table[:, channel][image[..., channel]]
    return pixels


def factor_of(paint: Paint) -> NDArray[np.float64]:
    """Linear light and opacity by which a material multiplies."""
    return np.clip(np.nan_to_num(np.array(paint.color)), 0.0, 1.0)


def mean_light(image: NDArray[np.uint8] | None) -> NDArray[np.float64]:
    """Mean of an image, linear light and opacity; ones without an image."""
    return np.ones(4) if image is None else linear_light(image).mean(axis=(0, 1))


def linear_light(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Linear light and opacity of pixels."""
    linear = image / 255
    linear[..., :3] = srgb_to_linear(linear[..., :3])
    return linear


def _encode(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(255 * linear_to_srgb(np.clip(linear, 0.0, 1.0))).astype(np.uint8)


def encoded(values: NDArray[np.float64], paint: Paint) -> NDArray[np.uint8]:
    """Pixels of linear light and opacity [..., 4]."""
    pixels = np.empty(values.shape, np.uint8)
    pixels[..., :3] = _encode(values[..., :3])
    pixels[..., 3] = _opacity(values[..., 3], paint)
    return pixels


def encoded_by_paint(
    values: NDArray[np.float64], looks: Looks, triangles: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """Pixels of triangles with their materials, for linear light.

    The values [k, n, 7] are reflected light, opacity and emitted light.
    """
    pixels = _encode(values)
    paint_of = looks.paint[triangles]
    for number in np.unique(paint_of):
        chosen = paint_of == number
        pixels[chosen, ..., 3] = _opacity(values[chosen, ..., 3], looks.paints[number])
    return pixels


def _opacity(opacity: NDArray[np.float64], paint: Paint) -> NDArray[np.uint8]:
    """Opacity as pixels: a mask is whole or not, and opaque materials have none."""
    if paint.alpha == MASK:
        return np.where(opacity >= paint.cutoff, 255, 0).astype(np.uint8)
    if paint.alpha == BLEND:
        return np.rint(255 * np.clip(opacity, 0.0, 1.0)).astype(np.uint8)
    return np.full(np.shape(opacity), 255, np.uint8)
