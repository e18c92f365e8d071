"""sRGB to linear light, in numbers and in textures."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from .resources import OwnedObjects

SRGB8_ALPHA8 = 0x8C43


def linear(srgb: Any) -> NDArray[np.float64]:
    """Linear values of sRGB values, both 0 to 1 (IEC 61966-2-1)."""
    value = np.asarray(srgb, dtype=np.float64)
    return np.where(value <= 0.04045, value / 12.92, ((np.maximum(value, 0.04045) + 0.055) / 1.055) ** 2.4)


def srgb_texture(ctx: OwnedObjects, pixels: NDArray[np.uint8]) -> moderngl.Texture:
    """Repeating, mip-mapped texture of sRGB pixels [height, width, 3], first row at v = 0; it reads as linear light."""
    height, width, _ = pixels.shape
    opaque = np.concatenate([pixels, np.full((height, width, 1), 255, dtype=np.uint8)], axis=2)
    texture = ctx.texture((width, height), 4, opaque.tobytes(), internal_format=SRGB8_ALPHA8)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    return texture
