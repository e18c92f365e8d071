"""Textures of sRGB pixels, which read as linear light."""

from __future__ import annotations

import warnings
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.errors import RippleWarning

from .resources import Resources

SRGB8_ALPHA8 = 0x8C43


def srgb_texture(resources: Resources, pixels: NDArray[np.uint8]) -> moderngl.Texture:
    """Repeating texture with mipmaps, of pixels [height, width, 3], the first row at v = 0.

    Where the driver takes none as large it is scaled down, with a warning.
    """
    pixels = fitted(pixels, _limit(resources, "GL_MAX_TEXTURE_SIZE"))
    height, width, _ = pixels.shape
    texture = resources.texture((width, height), 4, _opaque(pixels), internal_format=SRGB8_ALPHA8)
    return _trilinear(texture)


def srgb_cube(resources: Resources, pixels: NDArray[np.uint8]) -> moderngl.TextureCube:
    """Cube map with mipmaps, of pixels [6 size, size, 3]: its faces below one another."""
    largest = _limit(resources, "GL_MAX_CUBE_MAP_TEXTURE_SIZE")
    faces = [fitted(face, largest) for face in np.split(pixels, 6)]
    pixels, size = np.concatenate(faces), faces[0].shape[1]
    return _trilinear(resources.texture_cube((size, size), 4, _opaque(pixels), internal_format=SRGB8_ALPHA8))


def fitted(pixels: NDArray[np.uint8], largest: int) -> NDArray[np.uint8]:
    """Pixels [height, width, 3] scaled down so that neither side is longer than `largest`."""
    height, width, _ = pixels.shape
    if max(height, width) <= largest:
        return pixels
    scale = largest / max(height, width)
    size = max(1, round(scale * width)), max(1, round(scale * height))
    warnings.warn(
        f"a texture of {width}x{height} pixels is larger than the {largest} that the OpenGL driver takes: it is scaled "
        f"down to {size[0]}x{size[1]}",
        RippleWarning,
        stacklevel=3,
    )
    return np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BOX))


def _limit(resources: Resources, name: str) -> int:
    with resources.gl as ctx:
        return int(ctx.info[name])


def _opaque(pixels: NDArray[np.uint8]) -> bytes:
    return np.concatenate([pixels, np.full((*pixels.shape[:2], 1), 255, dtype=np.uint8)], axis=2).tobytes()


def _trilinear(texture: Any) -> Any:
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture
