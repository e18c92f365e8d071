"""The small panels: a bar of colours, a clock, a label, the scale of the arrows."""

from __future__ import annotations

import numpy as np

from .arrows import draw_arrow
from .colormap import colors
from .layout import Layout
from .patch import FAINT, INK, Color, Patch, text_width
from .scale import number, readable

PANEL_OPACITY = 0.86
_PADDING = 0.75  # in ems, as all measures below


def panel(width: int, height: int, em: int) -> Patch:
    """An empty panel."""
    patch = Patch(width, height)
    patch.panel(0.45 * em, PANEL_OPACITY)
    return patch


def label(text: str, em: int, detail: str = "", color: Color = INK) -> Patch:
    """One line of text, and a fainter one after it."""
    pad, small = round(_PADDING * em), round(0.85 * em)
    middle = text_width(text, em) + (0.6 * em if detail else 0)
    patch = panel(round(2 * pad + middle + text_width(detail, small)), round(1.9 * em), em)
    baseline = 1.3 * em
    patch.text(pad, baseline, text, em, color)
    patch.text(pad + middle, baseline, detail, small, FAINT)
    return patch


def color_bar(layout: Layout, name: str, unit: str, limit: float, goal: float) -> Patch:
    """A bar of the colours from -limit to limit, whose pointed ends stand for what is beyond.

    Numbers stand at zero and at half and whole of `goal`, as far as the bar reaches.
    """
    em = layout.em
    pad, small = round(_PADDING * em), round(0.85 * em)
    factor, prefixed = readable(goal, unit)
    patch = panel(layout.panel_width(18), round(4.1 * em), em)
    patch.text(pad, 1.35 * em, name, em)
    patch.text(patch.width - pad, 1.35 * em, prefixed, small, FAINT, "right")

    tip, top, bottom = 0.65 * em, round(1.85 * em), round(2.65 * em)
    left, right = pad + 1.2 * tip, patch.width - pad - 1.2 * tip
    middle, reach = (left + right) / 2, (right - left) / 2
    row = colors((np.arange(patch.width) + 0.5 - middle) / reach, 1.0)
    outline = [
        (left - tip, (top + bottom) / 2), (left, top), (right, top),
        (right + tip, (top + bottom) / 2), (right, bottom), (left, bottom),
    ]  # fmt: skip
    patch.polygon(outline, np.broadcast_to(row, (patch.height, patch.width, 3)))
    hair = max(1.0, em / 16)
    for value in (-goal, -goal / 2, 0.0, goal / 2, goal):
        if abs(value) <= 1.001 * limit:
            x = round(middle + reach * value / limit - hair / 2)
            patch.box(x, bottom, x + hair, bottom + 0.25 * em, INK)
            patch.text(x + hair / 2, 3.65 * em, number(value * factor), small, INK, "middle")
    return patch


def arrow_key(layout: Layout, scale: float, goal: float) -> Patch:
    """The arrow of the impulse `goal` / 2 [N s], as long as it is in the scene under `scale`, and its number."""
    em = layout.em
    pad, gap = round(_PADDING * em), 0.7 * em
    factor, unit = readable(goal / 2, "N s")
    text = f"{number(goal / 2 * factor)} {unit}"
    length = layout.arrow_length * min(goal / 2 / scale, 1.0)
    patch = panel(round(2 * pad + length + gap + text_width(text, em)), round(1.9 * em), em)
    draw_arrow(patch, (pad + length, 0.95 * em), (pad, 0.95 * em), layout.arrow_thickness)
    patch.text(pad + length + gap, 1.3 * em, text, em)
    return patch
