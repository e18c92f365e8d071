"""Looks: the colours that the author of a file gave its triangles.

A triangle has a material, and its corners have texture coordinates and, in some files, colours.
The colour of a point is the material's colour times its image times the corners' colours, all of
them linear light.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# Ways in which an image goes on beyond its edges.
REPEAT = "repeat"
CLAMP = "clamp"
MIRROR = "mirror"

# Ways in which opacity counts.
OPAQUE = "opaque"
MASK = "mask"
BLEND = "blend"

# Opacity below which a masked surface has a hole (glTF 2.0, section 3.9.4).
MASK_CUTOFF = 0.5


# Opacity below which colours are not seen.
CLEAR = 0.01


@dataclasses.dataclass(frozen=True)
class ImageSource:
    """An image that a file names or holds.

    Attributes
    ----------
    source : Path or bytes
        The image's file, or its content.
    name : str
        Its name in messages.
    """

    source: Path | bytes
    name: str


@dataclasses.dataclass(frozen=True)
class Paint:
    """A material of a file.

    Attributes
    ----------
    color : tuple
        Red, green, blue (linear light) and opacity, 0 to 1.
    image : ImageSource, optional
        sRGB and opacity, in the texture coordinates of the corners.
    opacity : ImageSource, optional
        Its brightness is the opacity, in place of the opacity of `image`.
    wrap : (str, str)
        How the images go on beyond their edges along u and v: `REPEAT`, `CLAMP` or `MIRROR`.
    alpha : str
        How opacity counts: `OPAQUE` (not at all), `MASK` or `BLEND`.
    cutoff : float
        Opacity below which a `MASK` has holes.
    metallic, roughness : float, optional
        0 to 1; None where the file gives none.
    gloss : ImageSource, optional
        Factors of roughness (green) and metallic (blue).
    emission : tuple
        Red, green and blue of the light that the surface emits, linear.
    emission_image : ImageSource, optional
        sRGB, by which the emission is multiplied.
    unlit : bool
        Whether the surface shows its colour without light, in place of `emission`.
    """

    color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    image: ImageSource | None = None
    opacity: ImageSource | None = None
    wrap: tuple[str, str] = (REPEAT, REPEAT)
    alpha: str = OPAQUE
    cutoff: float = MASK_CUTOFF
    metallic: float | None = None
    roughness: float | None = None
    gloss: ImageSource | None = None
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_image: ImageSource | None = None
    unlit: bool = False


@dataclasses.dataclass(frozen=True, eq=False)
class Looks:
    """The materials and colours of triangles.

    Attributes
    ----------
    paints : tuple of Paint
        The file's materials.
    paint : int64 [triangle_count]
        Index of the material of each triangle.
    colors : float64 [triangle_count, 3, 4] or None
        Linear light and opacity of the corners, 0 to 1, by which the materials are multiplied.
    notes : tuple of str
        What the file has and the looks lack, such as a lost image, one line each.
    """

    paints: tuple[Paint, ...]
    paint: NDArray[np.int64]
    colors: NDArray[np.float64] | None = None
    notes: tuple[str, ...] = ()

    def of_triangles(
        self, triangle: NDArray[np.int64], colors: NDArray[np.float64] | None
    ) -> Looks:
        """Looks of other triangles, each with the material of one of these, and their colours."""
        return dataclasses.replace(self, paint=self.paint[triangle], colors=colors)


def linear_light(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear light of sRGB values from 0 to 1 (IEC 61966-2-1); a fourth channel stays."""
    linear = np.clip(np.nan_to_num(srgb), 0.0, 1.0)
    rgb = linear[..., :3]
    linear[..., :3] = np.where(
        rgb <= 0.04045, rgb / 12.92, ((np.maximum(rgb, 0.04045) + 0.055) / 1.055) ** 2.4
    )
    return linear


def with_opacity(colors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours [n, 3] or [n, 4] with opacity, [n, 4]; without one it is 1."""
    opaque = np.ones((len(colors), 4))
    opaque[:, : colors.shape[1]] = colors[:, :4]
    return opaque


def alpha_of(colors: NDArray[np.float64]) -> str:
    """How the opacity of corners' colours [..., 4] counts.

    It does not count where all are clear, which some programs write and do not mean.
    """
    opacity = colors[..., 3]
    is_clear = opacity.max(initial=0.0) < CLEAR
    return BLEND if opacity.min(initial=1.0) < 1 and not is_clear else OPAQUE


def unit_range(values: NDArray) -> NDArray[np.float64]:
    """Colours of a text or a table as numbers from 0 to 1.

    Unsigned integers have their type's range; other numbers are from 0 to 1, or to 255 where one
    of them is above 1.
    """
    if values.dtype.kind == "u":
        return values / np.iinfo(values.dtype).max
    numbers = np.nan_to_num(values.astype(np.float64))
    return numbers / 255 if numbers.max(initial=0.0) > 1 else numbers
