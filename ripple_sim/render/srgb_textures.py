"""Textures of sRGB pixels, which shaders read as linear light."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.solver.errors import warn_caller

from .resources import Resources

# OpenGL's number of the internal format of sRGB colours with alpha.
SRGB8_ALPHA8 = 0x8C43


def srgb_texture(resources: Resources, pixels: NDArray[np.uint8]) -> moderngl.Texture:
    """Repeating texture with mipmaps, from pixels [height, width, 3]; the first row is at v = 0.

    A texture that is too large for the driver is scaled down, with a warning.
    """
    size, opaque = _flat_texels(resources, pixels)
    return _trilinear(resources.texture(size, 4, opaque, internal_format=SRGB8_ALPHA8))


def srgb_cube(resources: Resources, pixels: NDArray[np.uint8]) -> moderngl.TextureCube:
    """Cube map with mipmaps, from pixels of its faces below one another, [6 size, size, 3].

    An image of another height is one image for all faces.
    """
    size, opaque = _cube_texels(resources, pixels)
    return _trilinear(resources.texture_cube((size, size), 4, opaque, internal_format=SRGB8_ALPHA8))


def write_srgb(
    resources: Resources,
    texture: moderngl.Texture | moderngl.TextureCube,
    pixels: NDArray[np.uint8],
) -> None:
    """Replace the pixels of a texture of `srgb_texture` or `srgb_cube`; the shape stays."""
    if isinstance(texture, moderngl.TextureCube):
        size, opaque = _cube_texels(resources, pixels)
        face = 4 * size * size
        for index in range(6):
            texture.write(index, opaque[index * face : (index + 1) * face])
    else:
        texture.write(_flat_texels(resources, pixels)[1])
    texture.build_mipmaps()


def _flat_texels(resources: Resources, pixels: NDArray[np.uint8]) -> tuple[tuple[int, int], bytes]:
    """Width and height of a flat texture, and its RGBA texels."""
    with resources.gl as ctx:
        pixels = fitted(pixels, ctx.info["GL_MAX_TEXTURE_SIZE"])
    height, width, _ = pixels.shape
    return (width, height), Image.fromarray(pixels).convert("RGBA").tobytes()


def _cube_texels(resources: Resources, pixels: NDArray[np.uint8]) -> tuple[int, bytes]:
    """Side of a cube map, and the RGBA texels of its faces, one after another."""
    if len(pixels) != 6 * pixels.shape[1]:
        pixels = np.concatenate([pixels[: pixels.shape[1]]] * 6)
    with resources.gl as ctx:
        faces = [
            fitted(face, ctx.info["GL_MAX_CUBE_MAP_TEXTURE_SIZE"]) for face in np.split(pixels, 6)
        ]
    return faces[0].shape[1], Image.fromarray(np.concatenate(faces)).convert("RGBA").tobytes()


def fitted(pixels: NDArray[np.uint8], largest: int) -> NDArray[np.uint8]:
    """Pixels [height, width, 3] scaled down so that neither side is longer than `largest`."""
    height, width, _ = pixels.shape
    if max(height, width) <= largest:
        return pixels
    scale = largest / max(height, width)
    size = max(1, round(scale * width)), max(1, round(scale * height))
    warn_caller(
        f"a texture of {width}x{height} pixels is larger than the {largest} that the OpenGL driver "
        f"takes: it is scaled down to {size[0]}x{size[1]}"
    )
    return np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BOX))


def _trilinear(texture: Any) -> Any:
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture
