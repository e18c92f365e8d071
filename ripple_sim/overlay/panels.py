"""What overlays put on a frame of any size, and where: small panels and contact marks.

Panels are a bar of colours, a clock, a label, the scale of the arrows. Contact marks are arrows as long as the impulse
is large, projected onto the frame, and faint where a geom hides them.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.camera import Pose

from .marks import FAINT, HEAD_WIDTH, INK, RIM, Color, Mark, Sprite, draw_arrow, text_width
from .notes import colors, number, readable


@dataclasses.dataclass(frozen=True)
class Layout:
    """Sizes that follow from a frame's.

    Parameters
    ----------
    width, height : int
        Of the frame [pixels].
    """

    width: int
    height: int

    @property
    def scale(self) -> float:
        """Size over that of a frame of 1280x720."""
        return math.sqrt(self.width * self.height / (1280 * 720))

    @property
    def em(self) -> int:
        """Size of the type [pixels]: 16 on 1280x720, and readable on small frames."""
        return max(9, round(16 * self.scale))

    @property
    def margin(self) -> int:
        """Between the panels and the frame's border, and between panels [pixels]."""
        return round(0.9 * self.em)

    @property
    def arrow_length(self) -> float:
        """Length [pixels] of an arrow at the end of its scale."""
        return 115.0 * self.scale

    @property
    def arrow_thickness(self) -> float:
        """Thickness [pixels] of an arrow's shaft."""
        return max(2.6 * self.scale, 1.3)

    def panel_width(self, ems: float) -> int:
        """Width of a panel [pixels], of which two must fit side by side."""
        return min(round(ems * self.em), (self.width - 3 * self.margin) // 2)

    def place(self, corner: str, width: int, height: int) -> tuple[int, int]:
        """Left and top of a panel in a corner of the frame, such as "bottom left", or in the middle of an edge."""
        left = (self.width - width) // 2
        if "left" in corner:
            left = self.margin
        elif "right" in corner:
            left = self.width - self.margin - width
        top = self.margin if "top" in corner else self.height - self.margin - height
        return left, top


_SHOWN_GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)
_TOUCHING = 0.004  # a geom in front of a point by this share of the distance does not hide it


class Projection:
    """The camera of one frame.

    Parameters
    ----------
    pose : Pose
        Of the camera.
    width, height : int
        Of the frame [pixels].
    """

    def __init__(self, pose: Pose, width: int, height: int) -> None:
        self._pose, self._middle = pose, np.array([width / 2, height / 2])
        self._focal = height / 2 / np.tan(np.radians(pose.fovy) / 2)

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels [k, 2] of points [k, 3] in the world: x to the right, y down; NaN behind the camera."""
        local = (points - self._pose.position) @ self._pose.rotation
        depth = np.where(local[:, 2:] < 0, -local[:, 2:], np.nan)
        return self._middle + self._focal * local[:, :2] * [1.0, -1.0] / depth

    def metres(self, point: NDArray[np.float64]) -> float:
        """Length [m] of a pixel at a point's distance."""
        return float((self._pose.position - point) @ self._pose.rotation[:, 2]) / self._focal

    def seen(self, model: Any, data: Any, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether no geom of a MuJoCo model, its targets undeformed, hides points [k, 3] in the world."""
        eye, hit = self._pose.position, np.zeros(1, np.int32)
        ways = points - eye
        reach = np.array([mujoco.mj_ray(model, data, eye, way, _SHOWN_GROUPS, 1, -1, hit) for way in ways])
        return (reach < 0) | (reach > 1 - _TOUCHING)


_LONGEST = 1.5  # times the scale's arrow; a growing scale lags for a moment
_HIDDEN = 0.3  # opacity behind other geoms
_SAMPLES = 9  # along an arrow, to find its hidden parts


class PlacedMark(NamedTuple):
    """An arrow on a frame: its ends [pixels], and its opacity along it."""

    tip: NDArray[np.float64]
    tail: NDArray[np.float64]
    opacity: NDArray[np.float64]


def place_marks(
    marks: Sequence[Mark], scale: float, layout: Layout, projection: Projection, model: Any, data: Any
) -> list[PlacedMark]:
    """Place contact marks on a frame.

    Arrows stand on the surface, in perspective except for their size, the same at any distance. Hidden parts are faint.

    Parameters
    ----------
    marks : sequence of Mark
    scale : float
        Impulse [N s] of an arrow of length `Layout.arrow_length`, seen from the side.
    layout : Layout
    projection : Projection
        Of this frame.
    model, data : mujoco.MjModel, mujoco.MjData
        Whose geoms may hide the arrows.
    """
    placed = []
    for mark in marks:
        length = layout.arrow_length * projection.metres(mark.point) * min(mark.impulse / scale, _LONGEST)
        points = mark.point + length * np.linspace(0, 1, _SAMPLES)[:, None] * mark.axis
        pixels = projection.pixels(points)
        if np.isfinite(pixels).all():
            opacity = mark.opacity * np.where(projection.seen(model, data, points), 1.0, _HIDDEN)
            placed.append(PlacedMark(pixels[0], pixels[-1], opacity))
    return placed


def draw_marks(frame: NDArray[np.uint8], marks: Sequence[PlacedMark], layout: Layout) -> None:
    """Draw contacts over a frame, uint8 [height, width, 3 or 4], in place; the later ones cover the earlier."""
    thickness = layout.arrow_thickness
    reach = thickness * (HEAD_WIDTH + RIM) + 1
    for tip, tail, opacity in marks:
        low = np.floor(np.maximum(np.minimum(tip, tail) - reach, 0)).astype(int)
        high = np.ceil(np.minimum(np.maximum(tip, tail) + reach, frame.shape[1::-1])).astype(int)
        if (low < high).all():
            sprite = Sprite(int(high[0] - low[0]), int(high[1] - low[1]))
            draw_arrow(sprite, tip - low, tail - low, thickness, opacity)
            sprite.over(frame, int(low[0]), int(low[1]))


PANEL_OPACITY = 0.86
_PADDING = 0.75  # in ems, as all measures below


def panel(width: int, height: int, em: int) -> Sprite:
    """An empty panel."""
    sprite = Sprite(width, height)
    sprite.panel(0.45 * em, PANEL_OPACITY)
    return sprite


def label(text: str, em: int, detail: str = "", color: Color = INK) -> Sprite:
    """One line of text, followed by a fainter detail."""
    pad, small = round(_PADDING * em), round(0.85 * em)
    middle = text_width(text, em) + (0.6 * em if detail else 0)
    sprite = panel(round(2 * pad + middle + text_width(detail, small)), round(1.9 * em), em)
    baseline = 1.3 * em
    sprite.text(pad, baseline, text, em, color)
    sprite.text(pad + middle, baseline, detail, small, FAINT)
    return sprite


def color_bar(layout: Layout, name: str, unit: str, limit: float, goal: float) -> Sprite:
    """A colour bar from -limit to limit, with pointed ends for values beyond.

    Labels are at zero and at half and whole of `goal`, within the bar.
    """
    em = layout.em
    pad, small = round(_PADDING * em), round(0.85 * em)
    factor, prefixed = readable(goal, unit)
    sprite = panel(layout.panel_width(18), round(4.1 * em), em)
    sprite.text(pad, 1.35 * em, name, em)
    sprite.text(sprite.width - pad, 1.35 * em, prefixed, small, FAINT, "right")

    tip, top, bottom = 0.65 * em, round(1.85 * em), round(2.65 * em)
    left, right = pad + 1.2 * tip, sprite.width - pad - 1.2 * tip
    middle, reach = (left + right) / 2, (right - left) / 2
    row = colors((np.arange(sprite.width) + 0.5 - middle) / reach, 1.0)
    outline = [
        (left - tip, (top + bottom) / 2), (left, top), (right, top),
        (right + tip, (top + bottom) / 2), (right, bottom), (left, bottom),
    ]  # fmt: skip
    sprite.polygon(outline, np.broadcast_to(row, (sprite.height, sprite.width, 3)))
    hair = max(1.0, em / 16)
    for value in (-goal, -goal / 2, 0.0, goal / 2, goal):
        if abs(value) <= 1.001 * limit:
            x = round(middle + reach * value / limit - hair / 2)
            sprite.box(x, bottom, x + hair, bottom + 0.25 * em, INK)
            sprite.text(x + hair / 2, 3.65 * em, number(value * factor), small, INK, "middle")
    return sprite


def arrow_key(layout: Layout, scale: float, goal: float) -> Sprite:
    """The arrow of the impulse `goal` / 2 [N s], as long as in the scene under `scale`, and its value."""
    em = layout.em
    pad, gap = round(_PADDING * em), 0.7 * em
    factor, unit = readable(goal / 2, "N s")
    text = f"{number(goal / 2 * factor)} {unit}"
    length = layout.arrow_length * min(goal / 2 / scale, 1.0)
    sprite = panel(round(2 * pad + length + gap + text_width(text, em)), round(1.9 * em), em)
    draw_arrow(sprite, (pad + length, 0.95 * em), (pad, 0.95 * em), layout.arrow_thickness)
    sprite.text(pad + length + gap, 1.3 * em, text, em)
    return sprite
