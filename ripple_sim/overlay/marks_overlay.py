"""Contact marks on a frame: arrows as long as the impulse is large."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arrows import HEAD_WIDTH, RIM, draw_arrow
from .contact_marks import Mark
from .layout import Layout
from .marks import Sprite
from .projection import Projection

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
