"""Draws panels over finished frames, stacked in the corners."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ripple_sim.scene.overlays import HEATMAPS, Request

from .energy_plot import COLORS, EnergyPlot
from .layout import Layout
from .marks import Sprite
from .notes import Notes
from .panels import arrow_key, color_bar, label


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
