"""Blocks of a packed image: of images, of images times colours, and of plain colours."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.mesh.looks import OPAQUE, Looks, Paint

from .paint_pixels import (
    encoded,
    encoded_by_paint,
    factor_of,
    linear_light,
    resized,
    sampled,
    scaled,
    tinted,
    wrapped,
)

# Pixels round a block, and the multiple of pixels at which it begins: three levels of mipmaps stay
# apart.
MARGIN = 8

# Side of the block of a plain colour [pixels], while there are few of them.
_SWATCH = 8

_SMALL_SWATCH = 2

_MANY_SWATCHES = 16_384

# Side of the square of a triangle whose colours change so much that they do not go on linearly.
_STEEP_SQUARE = 8

# Largest and smallest side of the block of a triangle that has an image and colours [pixels].
_LARGEST_TRIANGLE = 256

_SMALLEST_TRIANGLE = 4

# Pixels of such blocks that are computed together: 30 MB for an array of them.
_PIXELS_AT_ONCE = 2**20

# Gives the image of a material, [height, width, 4], sRGB and opacity, or None.
Decode = Callable[[Paint], NDArray[np.uint8] | None]


class Skin(NamedTuple):
    """A material with its decoded images: what it reflects, and what it emits.

    Attributes
    ----------
    paint : Paint
        Whose colour is what it reflects.
    image : uint8 [height, width, 4] or None
    glow : Paint or None
        Whose colour is what it emits; None if it emits nothing.
    glow_image : uint8 [height, width, 4] or None
        As large as `image`.
    """

    paint: Paint
    image: NDArray[np.uint8] | None
    glow: Paint | None
    glow_image: NDArray[np.uint8] | None


class Block(NamedTuple):
    """Pixels for some triangles, with a margin, and the corners' places in pixels from its corner.

    Attributes
    ----------
    pixels : uint8 [height, width, 4]
    triangles : int64 [k]
    places : float64 [k, 3, 2]
    glow : uint8 [height, width, 3] or None
        What the surface emits.
    """

    pixels: NDArray[np.uint8]
    triangles: NDArray[np.int64]
    places: NDArray[np.float64]
    glow: NDArray[np.uint8] | None = None


def skin_of(paint: Paint, decode: Decode) -> Skin:
    """A material with its images; one that has an image of its emission alone gets a white one."""
    image = decode(paint)
    if paint.unlit:
        black = dataclasses.replace(paint, color=(0.0, 0.0, 0.0, paint.color[3]))
        return Skin(black, image, dataclasses.replace(paint, alpha=OPAQUE), image)
    if max(paint.emission) <= 0:
        return Skin(paint, image, None, None)
    glow = Paint((*paint.emission, 1.0), wrap=paint.wrap)
    glow_image = decode(Paint(image=paint.emission_image))
    if glow_image is not None and image is None:
        image = np.full(glow_image.shape, 255, np.uint8)
    elif glow_image is not None and image is not None:
        glow_image = resized(glow_image, (image.shape[1], image.shape[0]))
    return Skin(paint, image, glow, glow_image)


def tinted_glow(skin: Skin) -> NDArray[np.uint8] | None:
    """What a material with an image emits, of the size of the image."""
    if skin.glow is None or skin.image is None:
        return None
    image = np.full_like(skin.image, 255) if skin.glow_image is None else skin.glow_image
    return np.ascontiguousarray(tinted(image, skin.glow)[..., :3])


def skin_blocks(
    skin: Skin,
    scale: float,
    triangles: NDArray[np.int64],
    uv: NDArray[np.float64],
    colors: NDArray[np.float64] | None,
) -> list[Block]:
    """Blocks of triangles whose material has an image; with the corners' colours, if any."""

    def blocks_of(image: NDArray[np.uint8], paint: Paint, tints: Any) -> list[Block]:
        smaller = scaled(image, scale)
        if tints is None:
            return [_image_block(smaller, paint, triangles, uv)]
        return _triangle_blocks(smaller, paint, triangles, uv, tints)

    if skin.image is None:
        return []
    blocks = blocks_of(skin.image, skin.paint, colors)
    if skin.glow is None:
        return blocks
    image = np.full_like(skin.image, 255) if skin.glow_image is None else skin.glow_image
    tints = colors
    if colors is not None and not skin.glow.unlit:
        tints = np.ones_like(colors)
    glows = blocks_of(image, skin.glow, tints)
    return [
        block._replace(glow=glow.pixels[..., :3]) for block, glow in zip(blocks, glows, strict=True)
    ]


def _image_block(
    image: NDArray[np.uint8],
    paint: Paint,
    triangles: NDArray[np.int64],
    uv: NDArray[np.float64],
) -> Block:
    """The part of an image that triangles show, with what lies beyond its edges."""
    height, width = image.shape[:2]
    places = uv * [width, height]
    low = np.floor(places.min(axis=(0, 1))).astype(np.int64) - MARGIN
    high = np.ceil(places.max(axis=(0, 1))).astype(np.int64) + MARGIN
    columns = wrapped(np.arange(low[0], high[0]), width, paint.wrap[0])
    rows = wrapped(np.arange(low[1], high[1]), height, paint.wrap[1])
    return Block(tinted(image, paint)[np.ix_(rows, columns)], triangles, places - low)


def _triangle_blocks(
    image: NDArray[np.uint8],
    paint: Paint,
    triangles: NDArray[np.int64],
    uv: NDArray[np.float64],
    colors: NDArray[np.float64],
) -> list[Block]:
    """Blocks of triangles, each with a square of its own: the image times the corners' colours.

    The squares' sides are powers of two, about as many pixels as the image has there.
    """
    height, width = image.shape[:2]
    places = uv * [width, height]
    levels = square_levels(places)
    linear = linear_light(image)
    blocks = []
    for level in np.unique(levels):
        chosen = levels == level
        side = 2**level
        weights = _square_weights(side)
        numbers = np.flatnonzero(chosen)
        squares = np.empty((len(numbers), side, side, 4), np.uint8)
        step = max(1, _PIXELS_AT_ONCE // side**2)
        for first in range(0, len(numbers), step):
            part = numbers[first : first + step]
            # half a square's pixels lie beyond the triangle, and go on linearly
            at = np.einsum("rck,mkx->mrcx", weights, places[part])
            tint = np.clip(np.einsum("rck,mkx->mrcx", weights, colors[part]), 0.0, 1.0)
            values = sampled(linear, at, paint.wrap) * factor_of(paint) * tint
            squares[first : first + step] = encoded(values, paint)
        blocks.append(_grid(squares, triangles[numbers]))
    return blocks


def square_levels(places: NDArray[np.float64]) -> NDArray[np.int64]:
    """Exponents of two of the sides of the squares for triangles at places [m, 3, 2] [pixels]."""
    sides = np.linalg.norm(places - np.roll(places, 1, axis=1), axis=2).max(axis=1)
    clipped = np.clip(sides, _SMALLEST_TRIANGLE, _LARGEST_TRIANGLE)
    return np.ceil(np.log2(clipped)).astype(np.int64)


def plain_blocks(
    triangles: NDArray[np.int64],
    shades: NDArray[np.float64],
    glows: NDArray[np.float64],
    looks: Looks,
) -> list[Block]:
    """Blocks of triangles without an image: squares of one colour, or of the corners' colours.

    `shades` [k, 3, 4] are linear light and opacity of the corners, and `glows` [k, 3, 3] is the
    light that they emit.
    """
    shades = np.concatenate([shades, glows], axis=2)
    values = encoded_by_paint(shades, looks, triangles)
    even = (values == values[:, :1]).all(axis=(1, 2))
    blocks = []
    if even.any():
        swatches, number = np.unique(values[even, 0], axis=0, return_inverse=True)
        side = _SWATCH if len(swatches) < _MANY_SWATCHES else _SMALL_SWATCH
        squares = np.broadcast_to(swatches[:, None, None], (len(swatches), side, side, 7))
        grid = _grid(squares, np.arange(len(swatches)))
        # the middle of the square: one place for all corners
        middle = grid.places[:, :1] + 0.5 * (side - 1)
        places = np.repeat(middle[number.ravel()], 3, axis=1)
        blocks.append(grid._replace(triangles=triangles[even], places=places))
    uneven = np.flatnonzero(~even)
    # beyond the triangle its colours go on linearly, as far as there are such colours
    a, b, c = np.moveaxis(shades[uneven], 1, 0)
    beyond = b + c - a
    is_steep = ((beyond < 0) | (beyond > 1)).any(axis=1) & (len(uneven) < _MANY_SWATCHES)
    for side, chosen in ((2, uneven[~is_steep]), (_STEEP_SQUARE, uneven[is_steep])):
        if len(chosen):
            blended = np.einsum("rck,mkx->mrcx", _square_weights(side), shades[chosen])
            flat = np.clip(blended, 0.0, 1.0).reshape(len(chosen), -1, 7)
            pixels = encoded_by_paint(flat, looks, triangles[chosen])
            blocks.append(_grid(pixels.reshape(-1, side, side, 7), triangles[chosen]))
    return blocks


def _square_weights(side: int) -> NDArray[np.float64]:
    """Barycentric coordinates of the pixels of a square, of which a triangle covers one half.

    Its corners are the middles of the pixels at the upper left, the upper right and the lower left.
    """
    s, t = np.meshgrid(*(np.linspace(0, 1, side),) * 2)
    return np.stack([1 - s - t, s, t], axis=-1)


def _grid(squares: NDArray[np.uint8], triangles: NDArray[np.int64]) -> Block:
    """A block of squares, each of a triangle, as `_square_weights` says.

    The squares [k, side, side, 4 or 7] are sRGB and opacity, and sRGB of what is emitted.
    """
    count, side, _, channels = squares.shape
    across = math.ceil(math.sqrt(count))
    down = math.ceil(count / across)
    grid = np.zeros((down * across, side, side, channels), np.uint8)
    grid[:count] = squares
    pixels = grid.reshape(down, across, side, side, channels).swapaxes(1, 2)
    pixels = pixels.reshape(down * side, across * side, channels)
    row, column = np.divmod(np.arange(count), across)
    first = np.stack([column, row], axis=1)[:, None] * side + 0.5
    places = first + np.array([[0, 0], [side - 1, 0], [0, side - 1]])
    glow = pixels[..., 4:] if channels > 4 and pixels[..., 4:].any() else None
    return Block(pixels[..., :4], triangles, places, glow)
