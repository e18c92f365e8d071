"""Draws panels over finished frames, stacked in the corners; one is the plot of energy, which grows with the video."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.scene.scene import HEATMAPS, Request

from .marks import FAINT, INK, Color, Sprite, text_width
from .notes import Notes, number, readable, round_up
from .panels import Layout, arrow_key, color_bar, label, panel

Curve = tuple[NDArray[np.float64], NDArray[np.float64]]  # times [s], values

COLORS = ((38, 92, 160), (196, 88, 52))  # of the curves
_GRID = (150, 158, 170)


class EnergyPlot:
    """Draws curves over the time of the whole video.

    Parameters
    ----------
    layout : Layout
    title, unit : str
    duration : float
        [s].
    names : sequence of str
        Of several curves.
    """

    def __init__(self, layout: Layout, title: str, unit: str, duration: float, names: Sequence[str] = ()) -> None:
        self._em, self._title, self._unit = layout.em, title, unit
        self._duration, self._names = duration, names
        em = layout.em
        self._width, self._height = layout.panel_width(23), round(min(8.6 * em, 0.38 * layout.height))
        self._left, self._right = round(3.6 * em), self._width - round(1.1 * em)
        self._top, self._bottom = round(2.4 * em), self._height - round(1.95 * em)
        self._axes: tuple[tuple[float, float], Sprite] | None = None

    def draw(self, curves: Sequence[Curve], limit: float, goal: float) -> Sprite:
        """Draw curves up to the present, from 0 to `limit`, with labels at half and whole of `goal`."""
        if self._axes is None or self._axes[0] != (limit, goal):
            self._axes = (limit, goal), self._draw_axes(limit, goal)
        sprite = self._axes[1].copy()
        for color, (times, values) in zip(COLORS, curves, strict=False):
            self._draw_curve(sprite, times, values, limit, color)
        return sprite

    def _draw_axes(self, limit: float, goal: float) -> Sprite:
        em, small = self._em, round(0.85 * self._em)
        factor, prefixed = readable(goal, self._unit) if goal else (1.0, self._unit)
        sprite = panel(self._width, self._height, em)
        sprite.text(round(0.7 * em), 1.4 * em, self._title, em)
        sprite.text(round(0.7 * em) + text_width(self._title, em) + 0.5 * em, 1.4 * em, prefixed, small, FAINT)
        self._draw_names(sprite, small)
        hair = max(1, round(em / 16))
        half = [goal / 2] if self._bottom - self._top > 2.6 * small else []
        for value in [0.0, *half, goal] if goal else [0.0]:
            if value <= 1.001 * limit or not value:
                y = round(float(self._row(value, limit)))
                sprite.box(self._left, y - hair, self._right, y, INK if not value else _GRID, 0.9 if not value else 0.5)
                sprite.text(self._left - 0.4 * em, y + 0.3 * em, number(value * factor), small, INK, "right")
        step = round_up(self._duration / 4, (1.0, 2.0, 5.0))
        last = int(self._duration / step + 1e-9)
        for k in range(last + 1):
            x = round(float(self._column(k * step)))
            sprite.box(x, self._bottom, x + hair, self._bottom + 0.25 * em, INK)
            unit = " s" if k == last else ""
            sprite.text(x, self._bottom + 1.25 * em, number(k * step) + unit, small, INK, "middle")
        return sprite

    def _draw_names(self, sprite: Sprite, size: int) -> None:
        x = float(self._width - round(0.7 * self._em))
        titles = text_width(f"{self._title} {self._unit}", self._em) + self._em
        if sum(text_width(name, size) + 0.9 * self._em for name in self._names) > x - titles:
            return  # too narrow; the runs' titles have the curves' colours anyway
        for color, name in reversed(list(zip(COLORS, self._names, strict=False))):
            sprite.text(x, 1.4 * self._em, name, size, color, "right")
            x -= text_width(name, size) + 0.9 * self._em

    def _draw_curve(self, sprite: Sprite, times: NDArray, values: NDArray, limit: float, color: Color) -> None:
        if len(times) == 0 or limit <= 0:
            return
        end = float(self._column(times[-1]))
        edges = np.arange(self._left, int(np.ceil(end)) + 1)
        rows = np.interp(edges, self._column(times), self._row(values, limit))
        thick = self._em / 9
        slope = np.hypot(1.0, np.diff(rows))
        low, high = np.minimum(rows[1:], rows[:-1]), np.maximum(rows[1:], rows[:-1])
        line = _columns_between(low - thick / 2 * slope**0.5, high + thick / 2 * slope**0.5, self._height)
        under = _columns_between((low + high) / 2, np.full(len(low), float(self._bottom)), self._height)
        coverage = np.zeros((2, self._height, self._width), np.float32)
        coverage[:, :, edges[:-1]] = under, line
        if len(self._names) < 2:
            sprite.fill(coverage[0], color, 0.14)
        sprite.fill(coverage[1], color)
        sprite.disc(end, float(self._row(values[-1], limit)), 0.26 * self._em, color)

    def _column(self, time: ArrayLike) -> NDArray[np.float64]:
        return self._left + (self._right - self._left) * np.asarray(time, dtype=np.float64) / self._duration

    def _row(self, value: ArrayLike, limit: float) -> NDArray[np.float64]:
        share = np.asarray(value, dtype=np.float64) / (limit or 1.0)
        return self._bottom - (self._bottom - self._top) * np.clip(share, 0, 1)


def _columns_between(low: NDArray[np.float64], high: NDArray[np.float64], height: int) -> NDArray[np.float32]:
    """Share of each pixel [height, k] that lies between two rows, column by column."""
    edge = np.arange(height + 1)[:, None]
    return np.diff(np.clip(edge, low, high), axis=0).astype(np.float32)


class Painter:
    """Draws the requested panels.

    Parameters
    ----------
    request : Request
    layout : Layout
        Of the frames.
    duration : float
        Of the video [s].
    spacing : int
        Texels between the lines of the grid, where all targets have the same; 0 where they differ.
    titles : sequence of (str, str)
        Names of two runs side by side, and a remark about each.
    """

    def __init__(
        self,
        request: Request,
        layout: Layout,
        *,
        duration: float,
        spacing: int = 0,
        titles: Sequence[tuple[str, str]] = (),
    ) -> None:
        self._request, self._layout, self._titles = request, layout, titles
        self._energy_plot = EnergyPlot(self._layout, "wave energy", "J", duration, [title for title, _ in titles])
        self._spacing = spacing
        self._decimals = 2 if duration < 100 else 1
        # a title leaves room for the clock on the seam
        self._title_width = layout.width / 2 - 2 * layout.margin - 4.5 * layout.em
        # static panels are drawn once
        self._label = functools.lru_cache(maxsize=8)(label)
        self._bar = functools.lru_cache(maxsize=1)(color_bar)
        self._key = functools.lru_cache(maxsize=1)(arrow_key)

    def paint(self, frame: NDArray[np.uint8], notes: Notes) -> None:
        """Draw the panels over a frame, uint8 [height, width, 3 or 4], in place; there are none on a tiny one."""
        if self._layout.width < 20 * self._layout.em or self._layout.height < 10 * self._layout.em:
            return
        for corner, panels in self._panels(notes).items():
            self._stack(frame, corner, panels)

    def _panels(self, notes: Notes) -> dict[str, list[Sprite]]:
        """Panels by corner, those nearest to the frame's border first."""
        request, layout, em = self._request, self._layout, self._layout.em
        corners: dict[str, list[Sprite]] = {
            name: [] for name in ("top left", "top", "top right", "bottom left", "bottom right")
        }
        for corner, title, color in zip(("top left", "top right"), self._titles, COLORS, strict=False):
            panel = self._label(title[0], em, title[1], color)
            if panel.width > self._title_width:
                panel = self._label(title[0], em, "", color)
            corners[corner].append(panel)
        if request.time:
            clock = label(f"t = {notes.time:.{self._decimals}f} s", em)
            corners["top" if self._titles else "top left"].append(clock)
        if request.grid and self._spacing:
            cells = f"{self._spacing} \N{MULTIPLICATION SIGN} {self._spacing} texels"
            corners["top left"].append(self._label("grid", em, cells))
        if request.contacts and notes.mark_scale.value > 0:
            scale = notes.mark_scale
            corners["top right"].append(self._key(layout, scale.value, scale.goal))
        if request.heatmap:
            scale = notes.heatmap_scale
            bar = self._bar(layout, request.heatmap, HEATMAPS[request.heatmap], scale.value, scale.goal)
            corners["bottom left"].append(bar)
        if request.energy:
            scale = notes.energy_scale
            corners["bottom right"].append(self._energy_plot.draw(notes.energies, scale.value, scale.goal))
        return corners

    def _stack(self, frame: NDArray[np.uint8], corner: str, panels: Sequence[Sprite]) -> None:
        offset = 0
        for sprite in panels:
            left, top = self._layout.place(corner, sprite.width, sprite.height)
            sprite.over(frame, left, top + (offset if "top" in corner else -offset))
            offset += sprite.height + self._layout.margin // 2
