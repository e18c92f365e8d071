"""One image of many materials: the looks of a mesh, packed for renderers that take one texture.

Each material gets a block of the packed image. A block has a margin, where its image goes on as
its wrap mode says, so that filtered texels of a block never mix with another block.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.mesh.looks import MIRROR, REPEAT, Looks

from .paint_blocks import (
    MARGIN,
    Block,
    Decode,
    Skin,
    plain_blocks,
    skin_blocks,
    skin_of,
    square_levels,
    tinted_glow,
)
from .paint_pixels import factor_of, mean_light, tinted

# Longest side of a packed image [pixels]. It is longer where the colours of vertices need more.
_LONGEST_SIDE = 4096

# Times that an image may repeat along a side of a block. A triangle with more shows the mean.
_MOST_REPEATS = 64

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
    skins = {number: skin_of(looks.paints[number], decode) for number in numbers}
    colors = _varied_colors(looks)
    if len(skins) == 1 and colors is None:
        (skin,) = skins.values()
        if skin.image is not None and skin.paint.wrap == (REPEAT, REPEAT):
            return PackedImage(tinted(skin.image, skin.paint), uv, 1.0, tinted_glow(skin))
    scale = _first_scale(looks, uv, colors, skins)
    has_image = any(skin.image is not None for skin in skins.values())
    while True:
        blocks = _blocks(looks, uv, colors, skins, scale)
        can_shrink = has_image and scale > _LEAST_SCALE
        found = _laid_out(blocks, count, _LONGEST_SIDE if can_shrink else None, scale)
        if found is not None:
            return found
        scale *= _SHRINK


def _first_scale(
    looks: Looks,
    uv: NDArray[np.float64],
    colors: NDArray[np.float64] | None,
    skins: dict[int, Skin],
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
            area += float(np.prod(np.ptp(places, axis=(0, 1)) + 2 * MARGIN))
        else:
            area += float((4.0 ** square_levels(places)).sum())
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
    skins: dict[int, Skin],
    scale: float,
) -> list[Block]:
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
            glows[few] = (mean_light(skin.glow_image) * factor_of(skin.glow))[:3] * tint
        shades[few] *= mean_light(skin.image) * factor_of(skin.paint)
        if not is_plain.all():
            tints = None if colors is None else colors[triangles[~is_plain]]
            blocks += skin_blocks(skin, scale, triangles[~is_plain], local[~is_plain], tints)
    if plain.any():
        triangles = np.flatnonzero(plain)
        blocks += plain_blocks(triangles, shades[triangles], glows[triangles], looks)
    return blocks


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


def _laid_out(
    blocks: list[Block], count: int, longest: int | None, scale: float
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
    return -(-length // MARGIN) * MARGIN
