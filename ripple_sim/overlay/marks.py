"""`Sprite`: a small transparent image that is drawn once and laid over many frames."""

from __future__ import annotations

import functools
import importlib.util
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Color = tuple[int, int, int]

INK, FAINT, PAPER = (27, 36, 50), (97, 107, 122), (255, 255, 255)

_SUPERSAMPLING = 8
_CORNERS = {"left": 0.0, "middle": 0.5, "right": 1.0}


class Sprite:
    """Shapes and text with smooth edges on a transparent background.

    Coordinates are in pixels from the upper left corner, x to the right and y down; whole numbers lie between pixels.
    Colours are sRGB, 0 to 255.

    Parameters
    ----------
    width, height : int
        [pixels].
    """

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._color = np.zeros((height, width, 3), np.float32)  # times alpha
        self._alpha = np.zeros((height, width, 1), np.float32)

    def copy(self) -> Sprite:
        """A copy with the same content."""
        other = Sprite(self.width, self.height)
        other._color, other._alpha = self._color.copy(), self._alpha.copy()
        return other

    def fill(self, coverage: NDArray[np.floating], color: NDArray | Color, opacity: float = 1.0) -> None:
        """Lay a colour, or an image [height, width, 3], over the share `coverage`, 0 to 1, of each pixel."""
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
        across, down = _overlap(left, right, self.width), _overlap(top, bottom, self.height)
        self.fill(down[:, None] * across, color, opacity)

    def polygon(self, corners: list[tuple[float, float]], color: NDArray | Color, opacity: float = 1.0) -> None:
        """Fill a polygon."""
        self.fill(self._drawn(lambda draw, k: draw.polygon([(k * x, k * y) for x, y in corners], 255)), color, opacity)

    def disc(self, x: float, y: float, radius: float, color: Color) -> None:
        """Fill a circle."""
        across, down = np.arange(self.width) + 0.5 - x, np.arange(self.height) + 0.5 - y
        self.fill(np.clip(radius + 0.5 - np.hypot(across, down[:, None]), 0, 1), color)

    def panel(self, radius: float, opacity: float) -> None:
        """Fill the whole sprite with paper, its corners rounded."""
        size = (0, 0, _SUPERSAMPLING * self.width - 1, _SUPERSAMPLING * self.height - 1)
        self.fill(self._drawn(lambda draw, k: draw.rounded_rectangle(size, k * radius, 255)), PAPER, opacity)

    def text(self, x: float, y: float, text: str, size: int, color: Color = INK, align: str = "left") -> None:
        """Write a line on the baseline y that begins, is centred or ends at x ("left", "middle", "right")."""
        mask = Image.new("L", (self.width, self.height))
        x -= _CORNERS[align] * text_width(text, size)
        ImageDraw.Draw(mask).text((round(x), round(y)), text, font=_font(size), fill=255, anchor="ls")
        self.fill(np.asarray(mask, dtype=np.float32) / 255, color)

    def over(self, frame: NDArray[np.uint8], left: int, top: int) -> None:
        """Lay the sprite over a frame in place, clipped to it.

        The frame is uint8 [height, width, 3], or [height, width, 4] with straight alpha.
        """
        x0, y0 = max(left, 0), max(top, 0)
        x1, y1 = min(left + self.width, frame.shape[1]), min(top + self.height, frame.shape[0])
        if x0 >= x1 or y0 >= y1:
            return
        inside = np.s_[y0 - top : y1 - top, x0 - left : x1 - left]
        under, color, alpha = frame[y0:y1, x0:x1], self._color[inside], self._alpha[inside]
        if frame.shape[2] == 3:
            under[:] = under * (1 - alpha) + color + 0.5
            return
        below = under[..., 3:] / np.float32(255) * (1 - alpha)
        total = below + alpha
        under[..., :3] = (under[..., :3] * below + color) / np.maximum(total, 1e-6) + 0.5
        under[..., 3:] = 255 * total + 0.5

    def _drawn(self, paint: Callable[[ImageDraw.ImageDraw, int], None]) -> NDArray[np.float32]:
        """Coverage of what a function of (ImageDraw, enlargement) paints."""
        k = _SUPERSAMPLING
        large = Image.new("L", (k * self.width, k * self.height))
        paint(ImageDraw.Draw(large), k)
        return np.asarray(large.reduce(k), dtype=np.float32) / np.float32(255)


def text_width(text: str, size: int) -> float:
    """Width of a line of text [pixels]."""
    return _font(size).getlength(text)


@functools.lru_cache(maxsize=32)
def _font(size: int) -> ImageFont.FreeTypeFont:
    # Matplotlib ships DejaVu Sans, which has a minus sign, a micro sign, and digits of equal width
    package = importlib.util.find_spec("matplotlib")
    folder = Path((package.submodule_search_locations or [""])[0] if package else "")
    return ImageFont.truetype(folder / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf", size)


def _overlap(low: float, high: float, count: int) -> NDArray[np.float32]:
    """Share of each of `count` pixels in a row that lies between two places."""
    edge = np.arange(count + 1)
    inside = np.clip(edge, low, high)
    return np.diff(inside).astype(np.float32)
