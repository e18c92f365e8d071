"""One image of many materials: the looks of a mesh, packed for renderers that take one texture.

Each material gets a block of the packed image. A block has a margin, where its image goes on as
its wrap mode says, so that filtered texels of a block never mix with another block.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.render.tone_mapping import linear_to_srgb, srgb_to_linear
from ripple_sim.solver.mesh.looks import (
    BLEND,
    CLAMP,
    MASK,
    MIRROR,
    OPAQUE,
    REPEAT,
    Looks,
    Paint,
)

# Longest side of a packed image [pixels]. It is longer where the colours of vertices need more.
_LONGEST_SIDE = 4096

# Pixels round a block, and the multiple of pixels at which it begins: three levels of mipmaps stay
# apart.
_MARGIN = 8

# Side of the block of a plain colour [pixels], while there are few of them.
_SWATCH = 8
_SMALL_SWATCH = 2
_MANY_SWATCHES = 16_384

# Side of the square of a triangle whose colours change so much that they do not go on linearly.
_STEEP_SQUARE = 8

# Times that an image may repeat along a side of a block. A triangle with more shows the mean.
_MOST_REPEATS = 64

# Largest and smallest side of the block of a triangle that has an image and colours [pixels].
_LARGEST_TRIANGLE = 256
_SMALLEST_TRIANGLE = 4

# Pixels of such blocks that are computed together: 30 MB for an array of them.
_PIXELS_AT_ONCE = 2**20

# Share of a packed image that blocks fill, about.
_FILLED = 0.8

# Factor by which images shrink until they fit, and the least scale.
_SHRINK = 0.85
_LEAST_SCALE = 1 / 64


class PackedImage(NamedTuple):
    """A image and where triangles lie in it.

    Attributes
    ----------
    pixels : uint8 [height, width, 4]
        sRGB and opacity, top row first.
    uv : float64 [triangle_count, 3, 2]
        Texture coordinates of the corners; v is counted from the upper edge.
    scale : float
        By which the images were scaled to fit, 1 at most.
    glow : uint8 [height, width, 3] or None
        sRGB of the light that the surface emits; None if it emits none.
    """

    pixels: NDArray[np.uint8]
    uv: NDArray[np.float64]
    scale: float
    glow: NDArray[np.uint8] | None = None


class _Skin(NamedTuple):
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


class _Block(NamedTuple):
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


Decode = Callable[[Paint], NDArray[np.uint8] | None]


def packed(looks: Looks, corner_uv: NDArray[np.float64] | None, decode: Decode) -> PackedImage:
    """Pack looks into one image.

    A mesh whose only image repeats, without colours, keeps that image and its coordinates.

    Parameters
    ----------
    looks : Looks
    corner_uv : [triangle_count, 3, 2] or None
        Texture coordinates; v is counted from the lower edge.
    decode : callable
        Gives the image of a material, [height, width, 4], sRGB and opacity, or None.
    """
    count = len(looks.paint)
    uv = np.zeros((count, 3, 2)) if corner_uv is None else np.nan_to_num(corner_uv)
    # v from the upper edge, and nothing that is too large for pixels
    uv = np.clip(uv, -1e6, 1e6) * [1.0, -1.0] + [0.0, 1.0]
    numbers = np.unique(looks.paint).tolist()
    skins = {number: _skin(looks.paints[number], decode) for number in numbers}
    colors = _varied_colors(looks)
    if len(skins) == 1 and colors is None:
        (skin,) = skins.values()
        if skin.image is not None and skin.paint.wrap == (REPEAT, REPEAT):
            return PackedImage(_tinted(skin.image, skin.paint), uv, 1.0, _tinted_glow(skin))
    scale = _first_scale(looks, uv, colors, skins)
    has_image = any(skin.image is not None for skin in skins.values())
    while True:
        blocks = _blocks(looks, uv, colors, skins, scale)
        can_shrink = has_image and scale > _LEAST_SCALE
        found = _laid_out(blocks, count, _LONGEST_SIDE if can_shrink else None, scale)
        if found is not None:
            return found
        scale *= _SHRINK


def _skin(paint: Paint, decode: Decode) -> _Skin:
    """A material with its images; one that has an image of its emission alone gets a white one."""
    image = decode(paint)
    if paint.unlit:
        black = dataclasses.replace(paint, color=(0.0, 0.0, 0.0, paint.color[3]))
        return _Skin(black, image, dataclasses.replace(paint, alpha=OPAQUE), image)
    if max(paint.emission) <= 0:
        return _Skin(paint, image, None, None)
    glow = Paint((*paint.emission, 1.0), wrap=paint.wrap)
    glow_image = decode(Paint(image=paint.emission_image))
    if glow_image is not None and image is None:
        image = np.full(glow_image.shape, 255, np.uint8)
    elif glow_image is not None and image is not None:
        glow_image = _resized(glow_image, (image.shape[1], image.shape[0]))
    return _Skin(paint, image, glow, glow_image)


def _tinted_glow(skin: _Skin) -> NDArray[np.uint8] | None:
    """What a material with an image emits, of the size of the image."""
    if skin.glow is None or skin.image is None:
        return None
    image = np.full_like(skin.image, 255) if skin.glow_image is None else skin.glow_image
    return np.ascontiguousarray(_tinted(image, skin.glow)[..., :3])


def _first_scale(
    looks: Looks,
    uv: NDArray[np.float64],
    colors: NDArray[np.float64] | None,
    skins: dict[int, _Skin],
) -> float:
    """Scale at which the images may fit, of the area that they take as they are; 1 at most."""
    area = 0.0
    for number, skin in skins.items():
        if skin.image is None:
            continue
        height, width = skin.image.shape[:2]
        places = _near_origin(uv[looks.paint == number], looks.paints[number].wrap)
        places = places[np.ptp(places, axis=1).max(axis=1) <= _MOST_REPEATS] * [width, height]
        if not len(places):
            continue
        if colors is None:
            area += float(np.prod(np.ptp(places, axis=(0, 1)) + 2 * _MARGIN))
        else:
            area += float((4.0 ** _square_levels(places)).sum())
    return min(1.0, math.sqrt(_FILLED * _LONGEST_SIDE**2 / max(area, 1.0)))


def _varied_colors(looks: Looks) -> NDArray[np.float64] | None:
    """Colours of corners; None if all are white."""
    if looks.colors is None or (looks.colors == 1).all():
        return None
    return looks.colors


def _blocks(
    looks: Looks,
    uv: NDArray[np.float64],
    colors: NDArray[np.float64] | None,
    skins: dict[int, _Skin],
    scale: float,
) -> list[_Block]:
    """Blocks that hold all triangles: of images, of images times colours, of plain colours."""
    blocks = []
    plain = np.zeros(len(uv), dtype=bool)
    # linear light and opacity of triangles that are plain, at their corners
    shades = np.ones((len(uv), 3, 4)) if colors is None else colors.copy()
    # what they emit, linear light
    glows = np.zeros((len(uv), 3, 3))
    for number, skin in skins.items():
        triangles = np.flatnonzero(looks.paint == number)
        local = _near_origin(uv[triangles], skin.paint.wrap)
        is_plain = np.ptp(local, axis=1).max(axis=1) > _MOST_REPEATS
        if skin.image is None:
            is_plain[:] = True
        few = triangles[is_plain]
        plain[few] = True
        if skin.glow is not None:
            tint = shades[few, :, :3] if skin.glow.unlit else 1.0
            glows[few] = (_mean(skin.glow_image) * _factor(skin.glow))[:3] * tint
        shades[few] *= _mean(skin.image) * _factor(skin.paint)
        if not is_plain.all():
            tints = None if colors is None else colors[triangles[~is_plain]]
            blocks += _skin_blocks(skin, scale, triangles[~is_plain], local[~is_plain], tints)
    if plain.any():
        triangles = np.flatnonzero(plain)
        blocks += _plain_blocks(triangles, shades[triangles], glows[triangles], looks)
    return blocks


def _skin_blocks(
    skin: _Skin,
    scale: float,
    triangles: NDArray[np.int64],
    uv: NDArray[np.float64],
    colors: NDArray[np.float64] | None,
) -> list[_Block]:
    """Blocks of triangles whose material has an image; with the corners' colours, if any."""

    def blocks_of(image: NDArray[np.uint8], paint: Paint, tints: Any) -> list[_Block]:
        smaller = _scaled(image, scale)
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


def _factor(paint: Paint) -> NDArray[np.float64]:
    """Linear light and opacity by which a material multiplies."""
    return np.clip(np.nan_to_num(np.array(paint.color)), 0.0, 1.0)


def _mean(image: NDArray[np.uint8] | None) -> NDArray[np.float64]:
    """Mean of an image, linear light and opacity; ones without an image."""
    return np.ones(4) if image is None else _linear(image).mean(axis=(0, 1))


def _near_origin(uv: NDArray[np.float64], wrap: tuple[str, str]) -> NDArray[np.float64]:
    """Coordinates moved by whole images, so that each triangle's middle is in the first one."""
    moved = uv.copy()
    for axis, mode in enumerate(wrap):
        middle = uv[..., axis].mean(axis=1, keepdims=True)
        if mode == REPEAT:
            moved[..., axis] -= np.floor(middle)
        elif mode == MIRROR:
            moved[..., axis] -= 2 * np.floor(middle / 2)
        else:
            # beyond its edge a clamped image is the same everywhere
            moved[..., axis] = np.clip(uv[..., axis], -_MOST_REPEATS / 2, _MOST_REPEATS / 2)
    return moved


def _scaled(image: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    height, width = image.shape[:2]
    return _resized(image, (max(1, round(scale * width)), max(1, round(scale * height))))


def _resized(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """An image of another size (width, height)."""
    if size == image.shape[1::-1]:
        return image
    smaller = size[0] <= image.shape[1] and size[1] <= image.shape[0]
    filtering = Image.Resampling.BOX if smaller else Image.Resampling.BILINEAR
    return np.asarray(Image.fromarray(image).resize(size, filtering))


def _image_block(
    image: NDArray[np.uint8],
    paint: Paint,
    triangles: NDArray[np.int64],
    uv: NDArray[np.float64],
) -> _Block:
    """The part of an image that triangles show, with what lies beyond its edges."""
    height, width = image.shape[:2]
    places = uv * [width, height]
    low = np.floor(places.min(axis=(0, 1))).astype(np.int64) - _MARGIN
    high = np.ceil(places.max(axis=(0, 1))).astype(np.int64) + _MARGIN
    columns = _wrapped(np.arange(low[0], high[0]), width, paint.wrap[0])
    rows = _wrapped(np.arange(low[1], high[1]), height, paint.wrap[1])
    return _Block(_tinted(image, paint)[np.ix_(rows, columns)], triangles, places - low)


def _wrapped(index: NDArray[np.int64], size: int, mode: str) -> NDArray[np.int64]:
    """Pixels of an image that are seen at places within it and beyond."""
    if mode == CLAMP:
        return np.clip(index, 0, size - 1)
    if mode == MIRROR:
        place = index % (2 * size)
        return np.minimum(place, 2 * size - 1 - place)
    return index % size


def _triangle_blocks(
    image: NDArray[np.uint8],
    paint: Paint,
    triangles: NDArray[np.int64],
    uv: NDArray[np.float64],
    colors: NDArray[np.float64],
) -> list[_Block]:
    """Blocks of triangles, each with a square of its own: the image times the corners' colours.

    The squares' sides are powers of two, about as many pixels as the image has there.
    """
    height, width = image.shape[:2]
    places = uv * [width, height]
    levels = _square_levels(places)
    linear = _linear(image)
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
            values = _sampled(linear, at, paint.wrap) * _factor(paint) * tint
            squares[first : first + step] = _encoded(values, paint)
        blocks.append(_grid(squares, triangles[numbers]))
    return blocks


def _square_levels(places: NDArray[np.float64]) -> NDArray[np.int64]:
    """Exponents of two of the sides of the squares for triangles at places [m, 3, 2] [pixels]."""
    sides = np.linalg.norm(places - np.roll(places, 1, axis=1), axis=2).max(axis=1)
    clipped = np.clip(sides, _SMALLEST_TRIANGLE, _LARGEST_TRIANGLE)
    return np.ceil(np.log2(clipped)).astype(np.int64)


def _sampled(
    image: NDArray[np.float64], at: NDArray[np.float64], wrap: tuple[str, str]
) -> NDArray[np.float64]:
    """Linear interpolation between the pixels of an image at places [..., 2]."""
    height, width = image.shape[:2]
    low = np.floor(at - 0.5)
    share = at - 0.5 - low
    column, row = np.moveaxis(low.astype(np.int64), -1, 0)
    columns = [_wrapped(column + k, width, wrap[0]) for k in (0, 1)]
    rows = [_wrapped(row + k, height, wrap[1]) for k in (0, 1)]
    across, down = np.moveaxis(share, -1, 0)[..., None]
    upper = image[rows[0], columns[0]] * (1 - across) + image[rows[0], columns[1]] * across
    lower = image[rows[1], columns[0]] * (1 - across) + image[rows[1], columns[1]] * across
    return upper * (1 - down) + lower * down


def _plain_blocks(
    triangles: NDArray[np.int64],
    shades: NDArray[np.float64],
    glows: NDArray[np.float64],
    looks: Looks,
) -> list[_Block]:
    """Blocks of triangles without an image: squares of one colour, or of the corners' colours.

    `shades` [k, 3, 4] are linear light and opacity of the corners, and `glows` [k, 3, 3] is the
    light that they emit.
    """
    shades = np.concatenate([shades, glows], axis=2)
    values = _encoded_by_paint(shades, looks, triangles)
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
            pixels = _encoded_by_paint(flat, looks, triangles[chosen])
            blocks.append(_grid(pixels.reshape(-1, side, side, 7), triangles[chosen]))
    return blocks


def _square_weights(side: int) -> NDArray[np.float64]:
    """Barycentric coordinates of the pixels of a square, of which a triangle covers one half.

    Its corners are the middles of the pixels at the upper left, the upper right and the lower left.
    """
    s, t = np.meshgrid(*(np.linspace(0, 1, side),) * 2)
    return np.stack([1 - s - t, s, t], axis=-1)


def _grid(squares: NDArray[np.uint8], triangles: NDArray[np.int64]) -> _Block:
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
    return _Block(pixels[..., :4], triangles, places, glow)


def _tinted(image: NDArray[np.uint8], paint: Paint) -> NDArray[np.uint8]:
    """A image times the colour of a material."""
    factor = _factor(paint)
    pixels = image.copy()
    pixels[..., 3] = _opacity(image[..., 3] / 255 * factor[3], paint)
    if (factor[:3] == 1).all():
        return pixels
    # each channel has 256 values: a table is exact and fast
    table = _encode(srgb_to_linear(np.arange(256) / 255)[:, None] * factor[:3])
    for channel in range(3):
        pixels[..., channel] = table[:, channel][image[..., channel]]
    return pixels


def _linear(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Linear light and opacity of pixels."""
    linear = image / 255
    linear[..., :3] = srgb_to_linear(linear[..., :3])
    return linear


def _encode(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(255 * linear_to_srgb(np.clip(linear, 0.0, 1.0))).astype(np.uint8)


def _encoded(values: NDArray[np.float64], paint: Paint) -> NDArray[np.uint8]:
    """Pixels of linear light and opacity [..., 4]."""
    pixels = np.empty(values.shape, np.uint8)
    pixels[..., :3] = _encode(values[..., :3])
    pixels[..., 3] = _opacity(values[..., 3], paint)
    return pixels


def _encoded_by_paint(
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


def _laid_out(
    blocks: list[_Block], count: int, longest: int | None, scale: float
) -> PackedImage | None:
    """Blocks on shelves, the highest first; None if a side would be too long."""
    order = sorted(range(len(blocks)), key=lambda i: (-blocks[i].pixels.shape[0], i))
    area = sum(block.pixels.shape[0] * block.pixels.shape[1] for block in blocks)
    widest = max(block.pixels.shape[1] for block in blocks)
    width = max(_aligned(widest), _aligned(math.ceil(math.sqrt(area))))
    if longest is not None:
        width = min(width, longest)
    corners = {}
    x = y = shelf = 0
    for i in order:
        height, block_width = blocks[i].pixels.shape[:2]
        if x and x + block_width > width:
            x = 0
            y += shelf
            shelf = 0
        corners[i] = x, y
        x = _aligned(x + block_width)
        shelf = max(shelf, _aligned(height))
    height = y + shelf
    if longest is not None and max(widest, height) > longest:
        return None
    pixels = np.zeros((height, width, 4), np.uint8)
    pixels[..., 3] = 255
    glow = None
    if any(block.glow is not None for block in blocks):
        glow = np.zeros((height, width, 3), np.uint8)
    uv = np.zeros((count, 3, 2))
    for i, (left, top) in corners.items():
        block = blocks[i]
        rows, columns = block.pixels.shape[:2]
        pixels[top : top + rows, left : left + columns] = block.pixels
        if glow is not None and block.glow is not None:
            glow[top : top + rows, left : left + columns] = block.glow
        places = block.places + np.array([left, top])
        uv[block.triangles] = places / [width, height]
    return PackedImage(pixels, uv, scale, glow)


def _aligned(length: int) -> int:
    return -(-length // _MARGIN) * _MARGIN
