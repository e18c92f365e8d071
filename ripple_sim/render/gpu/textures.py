"""Textures of sRGB pixels, which read as linear light."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from .resources import Resources

SRGB8_ALPHA8 = 0x8C43


def srgb_texture(resources: Resources, pixels: NDArray[np.uint8]) -> moderngl.Texture:
    """Repeating texture with mipmaps, of pixels [height, width, 3], the first row at v = 0."""
    height, width, _ = pixels.shape
    texture = resources.texture((width, height), 4, _opaque(pixels), internal_format=SRGB8_ALPHA8)
    return _trilinear(texture)


def srgb_cube(resources: Resources, pixels: NDArray[np.uint8]) -> moderngl.TextureCube:
    """Cube map with mipmaps, of pixels [6 size, size, 3]: its faces below one another."""
    size = pixels.shape[1]
    return _trilinear(resources.texture_cube((size, size), 4, _opaque(pixels), internal_format=SRGB8_ALPHA8))


def _opaque(pixels: NDArray[np.uint8]) -> bytes:
    return np.concatenate([pixels, np.full((*pixels.shape[:2], 1), 255, dtype=np.uint8)], axis=2).tobytes()


def _trilinear(texture: Any) -> Any:
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture
