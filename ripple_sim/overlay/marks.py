"""Marks of contacts with the targets and their impulses, which stay long enough to be seen, and what draws them.

A `Sprite` is a small transparent image that is drawn once and laid over many frames: shapes, text,
and arrows with a light rim and smooth edges.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib.util
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.coupling.soft import target_pose
from ripple_sim.simulation import Simulation

Color = tuple[int, int, int]

INK = (27, 36, 50)
FAINT = (97, 107, 122)
PAPER = (255, 255, 255)

_SUPERSAMPLING = 8
_CORNERS = {"left": 0.0, "middle": 0.5, "right": 1.0}

# in thicknesses of the shaft
HEAD_LENGTH = 6.0
HEAD_WIDTH = 2.2
DOT = 1.5
RIM = 0.7
MEMORY = 0.25  # time in which a mark fades to 1/e [s]; it holds the impulse of about this time

# shares of its largest impulse at which a mark begins to fade, and disappears
_FADING = 0.35
_FADED = 0.08
_SAME_PLACE = 0.05  # contacts closer than this share of the target's size are one moving contact


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
        """Write a line on the baseline y that begins, is centred or ends at x ("left", "middle", "right")."""
        mask = Image.new("L", (self.width, self.height))
        x -= _CORNERS[align] * text_width(text, size)
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
        inside = np.s_[y0 - top : y1 - top, x0 - left : x1 - left]
        under = frame[y0:y1, x0:x1]
        color = self._color[inside]
        alpha = self._alpha[inside]
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


def overlap(low: ArrayLike, high: ArrayLike, count: int) -> NDArray[np.float32]:
    """Share of each of `count` pixels in a row, [count, k], that lies between two places, [k] or one."""
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
    way = np.asarray(tail, dtype=np.float64) - tip
    length = float(np.hypot(*way))
    along = way / max(length, 1e-9)
    x = np.arange(sprite.width) + 0.5 - tip[0]
    y = np.arange(sprite.height)[:, None] + 0.5 - tip[1]
    u = x * along[0] + y * along[1]
    across = np.abs(y * along[0] - x * along[1])
    # distance of the pixels from the shape, `u` along the arrow from its tip and `across`; negative
    # inside
    outside = np.hypot(u, across) - DOT * thickness
    if length >= DOT * thickness:  # else all of it is within the dot
        head = min(HEAD_LENGTH * thickness, length)
        half = HEAD_WIDTH / HEAD_LENGTH * head
        triangle = np.maximum((across * head - u * half) / np.hypot(head, half), u - head)
        shaft = np.maximum(across - thickness / 2, np.maximum(0.8 * head - u, u - length))
        outside = np.minimum(np.minimum(triangle, shaft), outside)
    place = np.clip(u / max(length, 1e-9), 0, 1) * (len(opacity) - 1)
    here = np.interp(place, np.arange(len(opacity)), opacity)
    sprite.fill(np.clip(0.5 - (outside - RIM * thickness), 0, 1) * here, PAPER, 0.9)
    sprite.fill(np.clip(0.5 - outside, 0, 1) * here, INK)


@dataclasses.dataclass(frozen=True, eq=False)
class Mark:
    """A contact.

    Attributes
    ----------
    point : float64 [3]
        On the rippled surface, in the world [m].
    axis : float64 [3]
        The surface's outward normal there, against which the contact presses.
    impulse : float
        [N s], with the weight exp(-age / MEMORY).
    opacity : float
        From 1 to 0 as the mark fades.
    """

    point: NDArray[np.float64]
    axis: NDArray[np.float64]
    impulse: float
    opacity: float = 1.0


@dataclasses.dataclass(eq=False)
class _Contact:
    geom: str
    other: str
    place: NDArray[np.float64]  # on the undeformed surface, in the geom's frame [m]
    texel: tuple[int, int, int]
    impulse: float = 0.0
    largest: float = 0.0


class ContactMarks:
    """Gathers the impulses of a running simulation.

    Parameters
    ----------
    dt : float
        Time between frames [s].
    """

    def __init__(self, simulation: Simulation, dt: float) -> None:
        self._simulation = simulation
        self._fade = math.exp(-dt / MEMORY)
        self._contacts: list[_Contact] = []
        ripples = simulation.ripples
        self._near = {
            name: _SAME_PLACE * float(np.ptp(ripples[name].atlas.mesh.V, axis=0).max())
            for name in ripples
        }

    def follow(self) -> list[Mark]:
        """Take in the simulation's present frame; return the marks to draw, the weakest first."""
        for contact in self._contacts:
            contact.impulse *= self._fade
        for impulse in self._simulation.impulses:
            self._add(impulse)
        self._contacts = [
            contact for contact in self._contacts if contact.impulse > _FADED * contact.largest
        ]
        touched = {contact.geom for contact in self._contacts}
        heights = {name: self._simulation.ripples[name].height for name in sorted(touched)}
        marks = []
        for contact in sorted(self._contacts, key=lambda contact: contact.impulse):
            (position, rotation) = self._pose(contact.geom)
            waves = self._simulation.ripples[contact.geom]
            normal = waves.atlas.normals[contact.texel]
            height = float(heights[contact.geom][contact.texel])
            place = (
                contact.place if waves.vertices is None else waves.atlas.positions[contact.texel]
            )
            opacity = min((contact.impulse / contact.largest - _FADED) / (_FADING - _FADED), 1.0)
            point = position + rotation @ (place + height * normal)
            marks.append(
                Mark(point, axis=rotation @ normal, impulse=contact.impulse, opacity=opacity)
            )
        return marks

    def _add(self, hit: Impulse) -> None:
        if hit.impulse <= 0:
            return
        position, rotation = self._pose(hit.geom)
        atlas = self._simulation.ripples[hit.geom].atlas
        # a fast target has moved since the contact
        place = atlas.project((hit.point - position) @ rotation)[0][0]
        for contact in self._contacts:
            same = (contact.geom, contact.other) == (hit.geom, hit.other)
            if same and np.linalg.norm(contact.place - place) < self._near[hit.geom]:
                break
        else:
            contact = _Contact(hit.geom, hit.other, place, hit.texel)
            self._contacts.append(contact)
        contact.place = place
        contact.texel = hit.texel
        contact.impulse += hit.impulse
        contact.largest = max(contact.largest, contact.impulse)

    def _pose(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return target_pose(self._simulation.data, self._simulation.ripples.geom_ids[name])
