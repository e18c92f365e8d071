"""The panels of the overlays: a line of text, a bar of colours, and the scale of the arrows."""

from __future__ import annotations

import numpy as np

from .color_map import colors
from .layout import Layout
from .scales import number, readable
from .sprite import FAINT, INK, Color, Sprite, draw_arrow, text_width

PANEL_OPACITY = 0.86
_PADDING = 0.75  # between the border of a panel and its content, in ems


def panel(width: int, height: int, em: int) -> Sprite:
    """An empty panel of a width and height, with type of the size `em` [pixels]."""
    sprite = Sprite(width, height)
    sprite.panel(0.45 * em, PANEL_OPACITY)
    return sprite


def label(text: str, em: int, detail: str = "", color: Color = INK) -> Sprite:
    """One line of text, followed by a fainter detail."""
    pad = round(_PADDING * em)
    small = round(0.85 * em)
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
    pad = round(_PADDING * em)
    small = round(0.85 * em)
    factor, prefixed = readable(goal, unit)
    sprite = panel(layout.panel_width(18), round(4.1 * em), em)
    sprite.text(pad, 1.35 * em, name, em)
    sprite.text(sprite.width - pad, 1.35 * em, prefixed, small, FAINT, "right")

    tip = 0.65 * em
    top = round(1.85 * em)
    bottom = round(2.65 * em)
    left = pad + 1.2 * tip
    right = sprite.width - pad - 1.2 * tip
    middle = (left + right) / 2
    reach = (right - left) / 2
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
    """The arrow of the impulse `goal` / 2, and its value.

    `scale` is the impulse of an arrow of full length in the scene. Impulses are in [N s].
    """
    em = layout.em
    pad = round(_PADDING * em)
    gap = 0.7 * em
    factor, unit = readable(goal / 2, "N s")
    text = f"{number(goal / 2 * factor)} {unit}"
    length = layout.arrow_length * min(goal / 2 / scale, 1.0)
    sprite = panel(round(2 * pad + length + gap + text_width(text, em)), round(1.9 * em), em)
    draw_arrow(sprite, (pad + length, 0.95 * em), (pad, 0.95 * em), layout.arrow_thickness)
    sprite.text(pad + length + gap, 1.3 * em, text, em)
    return sprite
