"""`Painter` draws the panels of the overlays over frames, stacked in the corners."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ripple_sim.scene.overlays import HEATMAPS, Request

from .layout import Layout
from .notes import Notes
from .panels import arrow_key, color_bar, label
from .plots import COLORS, EnergyPlot, trace_panel
from .sprite import Sprite

# Size of the smallest frame with panels, in ems.
_MIN_WIDTH = 20
_MIN_HEIGHT = 10

_CORNERS = ("top left", "top", "top right", "bottom left", "bottom right")


class Painter:
    """Draws the panels that are requested.

    Parameters
    ----------
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
        self._request = request
        self._layout = layout
        self._titles = titles
        names = [title for title, _ in titles]
        self._energy_plot = EnergyPlot(self._layout, duration, names, ledger=not names)
        self._spacing = spacing
        self._duration = duration
        self._decimals = 2 if duration < 100 else 1
        # a title leaves room for the clock, which is above the seam of the two runs
        self._title_width = layout.width / 2 - 2 * layout.margin - 4.5 * layout.em
        # panels that stay the same are drawn once
        self._label = functools.lru_cache(maxsize=8)(label)
        self._bar = functools.lru_cache(maxsize=1)(color_bar)
        self._key = functools.lru_cache(maxsize=1)(arrow_key)

    def paint(self, frame: NDArray[np.uint8], notes: Notes) -> None:
        """Draw the panels over a frame, uint8 [height, width, 3 or 4], in place.

        A tiny frame has no panels.
        """
        layout = self._layout
        if layout.width < _MIN_WIDTH * layout.em or layout.height < _MIN_HEIGHT * layout.em:
            return
        for corner, panels in self._panels(notes).items():
            offset = 0
            for sprite in panels:
                left, top = layout.place(corner, sprite.width, sprite.height)
                sprite.over(frame, left, top + (offset if "top" in corner else -offset))
                offset += sprite.height + layout.margin // 2

    def _panels(self, notes: Notes) -> dict[str, list[Sprite]]:
        """Panels by corner, the ones nearest to the frame's border first."""
        request = self._request
        layout = self._layout
        em = layout.em
        corners: dict[str, list[Sprite]] = {corner: [] for corner in _CORNERS}
        for run, (title, remark) in enumerate(self._titles):
            panel = self._label(title, em, remark, COLORS[run])
            if panel.width > self._title_width:
                panel = self._label(title, em, "", COLORS[run])
            corners["top left" if run == 0 else "top right"].append(panel)
        if request.time:
            clock = label(f"t = {notes.time:.{self._decimals}f} s", em)
            corners["top" if self._titles else "top left"].append(clock)
        if request.grid and self._spacing:
            cells = f"{self._spacing} \N{MULTIPLICATION SIGN} {self._spacing} texels"
            corners["top left"].append(self._label("grid", em, cells))
        if request.contacts and notes.mark_scale[0] > 0:
            corners["top right"].append(self._key(layout, *notes.mark_scale))
        if request.heatmap:
            unit = HEATMAPS[request.heatmap]
            bar = self._bar(layout, request.heatmap, unit, *notes.heatmap_scale)
            corners["bottom left"].append(bar)
        if request.sensors and notes.traces:
            corners["bottom right"].append(trace_panel(layout, notes.traces, self._duration))
        if request.energy:
            ledger = None if self._titles or not notes.ledgers else notes.ledgers[0]
            plot = self._energy_plot.draw(notes.energies, *notes.energy_scale, ledger)
            corners["bottom right"].append(plot)
        return corners
