"""`Sprite`: a small transparent image that is drawn once and laid over many frames.

Shapes, text, and arrows with a light rim; all edges are smooth.
"""

from __future__ import annotations

import functools
import importlib.util
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

Color = tuple[int, int, int]  # sRGB, 0 to 255

INK: Color = (27, 36, 50)  # of text and lines
FAINT: Color = (97, 107, 122)  # of text that says less
PAPER: Color = (255, 255, 255)  # of panels, and of the rim of arrows

_SUPERSAMPLING = 8  # of polygons and rounded corners, for smooth edges

# Share of the width of a text that is left of its x, by its alignment.
_ALIGNMENTS = {"left": 0.0, "middle": 0.5, "right": 1.0}

# Sizes of an arrow, in thicknesses of its shaft.
HEAD_LENGTH = 6.0
HEAD_WIDTH = 2.2  # half of it
DOT = 1.5  # radius of the dot at the tip
RIM = 0.7  # width of the light rim


class Sprite:
    """Shapes and text with smooth edges on a transparent background.

    Coordinates are in pixels from the upper left corner, x to the right and y down; whole numbers
    lie between pixels. Colours are sRGB, 0 to 255.

    Parameters
    ----------
    width, height : int
        [pixels].
    """

    def __init__(self, width: int, height: int) -> None:
        self.width = width
        self.height = height
        self._color = np.zeros((height, width, 3), np.float32)  # times alpha
        self._alpha = np.zeros((height, width, 1), np.float32)

    def fill(
        self, coverage: NDArray[np.floating], color: NDArray | Color, opacity: float = 1.0
    ) -> None:
        """Lay a colour, or an image [height, width, 3], over the sprite.

        `coverage` [height, width] is the share of each pixel that it covers, 0 to 1.
        """
        alpha = (opacity * coverage[..., None]).astype(np.float32)
        self._color += alpha * (np.asarray(color, dtype=np.float32) - self._color)
        self._alpha += alpha * (1 - self._alpha)

    def box(
        self,
        left: float,
        top: float,
        right: float,
        bottom: float,
        color: NDArray | Color,
        opacity: float = 1.0,
    ) -> None:
        """Fill an upright rectangle."""
        across = overlap(left, right, self.width)
        down = overlap(top, bottom, self.height)
        self.fill(down * across.T, color, opacity)

    def polygon(self, corners: list[tuple[float, float]], color: NDArray | Color) -> None:
        """Fill a polygon."""
        self.fill(
            self._drawn(lambda draw, k: draw.polygon([(k * x, k * y) for x, y in corners], 255)),
            color,
        )

    def disc(self, x: float, y: float, radius: float, color: Color) -> None:
        """Fill a circle."""
        across = np.arange(self.width) + 0.5 - x
        down = np.arange(self.height) + 0.5 - y
        self.fill(np.clip(radius + 0.5 - np.hypot(across, down[:, None]), 0, 1), color)

    def panel(self, radius: float, opacity: float) -> None:
        """Fill the whole sprite with paper, its corners rounded."""
        size = (0, 0, _SUPERSAMPLING * self.width - 1, _SUPERSAMPLING * self.height - 1)
        self.fill(
            self._drawn(lambda draw, k: draw.rounded_rectangle(size, k * radius, 255)),
            PAPER,
            opacity,
        )

    def text(
        self, x: float, y: float, text: str, size: int, color: Color = INK, align: str = "left"
    ) -> None:
        """Write a line of text on the baseline y.

        It begins at x if it is aligned "left", is centred at x ("middle"), or ends at x ("right").
        """
        mask = Image.new("L", (self.width, self.height))
        x -= _ALIGNMENTS[align] * text_width(text, size)
        ImageDraw.Draw(mask).text(
            (round(x), round(y)), text, font=_font(size), fill=255, anchor="ls"
        )
        self.fill(np.asarray(mask, dtype=np.float32) / 255, color)

    def over(self, frame: NDArray[np.uint8], left: int, top: int) -> None:
        """Lay the sprite over a frame in place, clipped to it.

        The frame is uint8 [height, width, 3], or [height, width, 4] with straight alpha.
        """
        x0 = max(left, 0)
        y0 = max(top, 0)
        x1 = min(left + self.width, frame.shape[1])
        y1 = min(top + self.height, frame.shape[0])
        if x0 >= x1 or y0 >= y1:
            return
        visible = np.s_[y0 - top : y1 - top, x0 - left : x1 - left]
        pixels = frame[y0:y1, x0:x1]
        color = self._color[visible]
        alpha = self._alpha[visible]
        if frame.shape[2] == 3:
            pixels[:] = pixels * (1 - alpha) + color + 0.5
            return
        alpha_below = pixels[..., 3:] / np.float32(255) * (1 - alpha)
        total = alpha_below + alpha
        pixels[..., :3] = (pixels[..., :3] * alpha_below + color) / np.maximum(total, 1e-6) + 0.5
        pixels[..., 3:] = 255 * total + 0.5

    def _drawn(self, paint: Callable[[ImageDraw.ImageDraw, int], None]) -> NDArray[np.float32]:
        """Coverage [height, width] of what `paint` draws.

        `paint` gets an ImageDraw, and the factor by which the ImageDraw is larger than the sprite.
        """
        factor = _SUPERSAMPLING
        large = Image.new("L", (factor * self.width, factor * self.height))
        paint(ImageDraw.Draw(large), factor)
        return np.asarray(large.reduce(factor), dtype=np.float32) / np.float32(255)


def text_width(text: str, size: int) -> float:
    """Width of a line of text [pixels]."""
    return _font(size).getlength(text)


@functools.lru_cache(maxsize=32)
def _font(size: int) -> ImageFont.FreeTypeFont:
    # Matplotlib ships DejaVu Sans, which has a minus sign, a micro sign, and digits of equal width
    package = importlib.util.find_spec("matplotlib")
    folder = Path((package.submodule_search_locations or [""])[0] if package else "")
    return ImageFont.truetype(folder / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf", size)


def overlap(low: ArrayLike, high: ArrayLike, count: int) -> NDArray[np.float32]:
    """Share [count, k] of each of `count` pixels in a row that lies between `low` and `high`.

    These are places [pixels] from the first pixel's beginning, [k] or a single one.
    """
    edge = np.arange(count + 1)[:, None]
    return np.diff(np.clip(edge, low, high), axis=0).astype(np.float32)


def draw_arrow(
    sprite: Sprite, tip: ArrayLike, tail: ArrayLike, thickness: float, opacity: ArrayLike = (1.0,)
) -> None:
    """Draw an arrow with a dot at its tip.

    Parameters
    ----------
    tip, tail : [2]
        [pixels], x to the right, y down.
    thickness : float
        Of the shaft [pixels].
    opacity : [k]
        0 to 1, at equal distances from tip to tail.
    """
    tip = np.asarray(tip, dtype=np.float64)
    opacity = np.asarray(opacity, dtype=np.float64)
    shaft = np.asarray(tail, dtype=np.float64) - tip
    length = float(np.hypot(*shaft))
    along = shaft / max(length, 1e-9)
    x = np.arange(sprite.width) + 0.5 - tip[0]
    y = np.arange(sprite.height)[:, None] + 0.5 - tip[1]
    # of each pixel: how far along the arrow from its tip, and how far off its axis [pixels]
    u = x * along[0] + y * along[1]
    across = np.abs(y * along[0] - x * along[1])
    # distance of each pixel from the shape [pixels], negative inside
    distance = np.hypot(u, across) - DOT * thickness
    if length >= DOT * thickness:  # else the dot covers the arrow
        head = min(HEAD_LENGTH * thickness, length)
        half = HEAD_WIDTH / HEAD_LENGTH * head
        to_head = np.maximum((across * head - u * half) / np.hypot(head, half), u - head)
        to_shaft = np.maximum(across - thickness / 2, np.maximum(0.8 * head - u, u - length))
        distance = np.minimum(np.minimum(to_head, to_shaft), distance)
    place = np.clip(u / max(length, 1e-9), 0, 1) * (len(opacity) - 1)
    pixel_opacity = np.interp(place, np.arange(len(opacity)), opacity)
    sprite.fill(np.clip(0.5 - (distance - RIM * thickness), 0, 1) * pixel_opacity, PAPER, 0.9)
    sprite.fill(np.clip(0.5 - distance, 0, 1) * pixel_opacity, INK)
