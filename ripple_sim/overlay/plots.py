"""Plots over the time of the whole video: curves of energy, and signals of sensors."""

from __future__ import annotations

import copy
import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.energy import Energy

from .layout import Layout
from .notes import Trace
from .panels import panel
from .scales import number, readable, round_up
from .sprite import FAINT, INK, Color, Sprite, overlap, text_width

Curve = tuple[NDArray[np.float64], NDArray[np.float64]]  # times [s], values

COLORS = ((38, 92, 160), (196, 88, 52))  # of the curves and titles of the runs
_GRID = (150, 158, 170)  # colour of the lines behind the curves
_TITLE = "wave energy"

_LEDGER_HEIGHT = 1.3  # of the line of numbers under the title, in ems
_LONGEST_ENTRY = "bodies \N{MINUS SIGN}0.88 mJ"  # of the line of numbers


class EnergyPlot:
    """Draws curves of energy over the time of the whole video.

    Parameters
    ----------
    duration : float
        [s].
    names : sequence of str
        Of several curves.
    ledger : bool
        Whether a line of numbers stands under the title.
    """

    def __init__(
        self, layout: Layout, duration: float, names: Sequence[str] = (), *, ledger: bool = False
    ) -> None:
        self._em = layout.em
        self._duration = duration
        self._names = names
        em = layout.em
        self._width = layout.panel_width(26 if ledger else 23)
        self._column_width = (self._width - 1.4 * em) / 3
        entry_width = text_width(_LONGEST_ENTRY, round(0.85 * em)) + 0.4 * em
        self._has_ledger = ledger and entry_width < self._column_width
        line = round(_LEDGER_HEIGHT * em) if self._has_ledger else 0
        self._height = round(min(8.6 * em, 0.38 * layout.height)) + line
        self._left = round(3.6 * em)
        self._right = self._width - round(1.1 * em)
        self._top = round(2.4 * em) + line
        self._bottom = self._height - round(1.95 * em)
        self._hair = max(1, round(em / 16))  # thickness of the lines [pixels]
        self._axes = functools.lru_cache(maxsize=1)(self._draw_axes)

    def draw(
        self, curves: Sequence[Curve], limit: float, goal: float, ledger: Energy | None = None
    ) -> Sprite:
        """Draw curves up to the present, and the ledger under the title.

        The axis of energy [J] goes from 0 to `limit`, and has labels at half and whole of `goal`.
        """
        sprite = copy.deepcopy(self._axes(limit, goal))
        for color, (times, values) in zip(COLORS, curves, strict=False):
            self._draw_curve(sprite, times, values, limit, color)
        if ledger is not None and self._has_ledger:
            self._draw_ledger(sprite, ledger)
        return sprite

    def _draw_ledger(self, sprite: Sprite, ledger: Energy) -> None:
        """Write the energies of bodies, waves and both in one line."""
        size = round(0.85 * self._em)
        baseline = 2.75 * self._em
        inks = {"bodies": INK, "waves": COLORS[0], "total": INK}
        for column, (name, ink) in enumerate(inks.items()):
            value = getattr(ledger, name)
            factor, unit = readable(abs(value), "J") if value else (1.0, "J")
            three_digits = float(f"{factor * value:.3g}")
            x = 0.7 * self._em + column * self._column_width
            sprite.text(x, baseline, name, size, FAINT if ink == INK else ink)
            x += text_width(name, size) + 0.4 * self._em
            sprite.text(x, baseline, f"{number(three_digits)} {unit}", size, ink)

    def _draw_axes(self, limit: float, goal: float) -> Sprite:
        """The panel without curves: title, names, and the axes."""
        factor, unit = readable(goal, "J") if goal else (1.0, "J")
        sprite = panel(self._width, self._height, self._em)
        self._draw_title(sprite, unit)
        self._draw_energy_axis(sprite, limit, goal, factor)
        self._draw_time_axis(sprite)
        return sprite

    def _draw_title(self, sprite: Sprite, unit: str) -> None:
        """Write the title, the unit of the energies, and the names of the curves, in one line."""
        em = self._em
        small = round(0.85 * em)
        baseline = 1.4 * em
        left = round(0.7 * em)
        sprite.text(left, baseline, _TITLE, em)
        sprite.text(left + text_width(_TITLE, em) + 0.5 * em, baseline, unit, small, FAINT)
        x = float(self._width - round(0.7 * em))
        title_width = text_width(f"{_TITLE} J", em) + em
        names_width = sum(text_width(name, small) + 0.9 * em for name in self._names)
        # without room for the names, the titles of the runs have the colours of the curves anyway
        if names_width <= x - title_width:
            for color, name in reversed(list(zip(COLORS, self._names, strict=False))):
                sprite.text(x, baseline, name, small, color, "right")
                x -= text_width(name, small) + 0.9 * em

    def _draw_energy_axis(self, sprite: Sprite, limit: float, goal: float, factor: float) -> None:
        """Draw lines at 0, and at half and whole of `goal` [J]; their labels are `factor` times."""
        em = self._em
        small = round(0.85 * em)
        hair = self._hair
        has_room = self._bottom - self._top > 2.6 * small
        values = [0.0]
        if goal:
            values = [0.0, goal / 2, goal] if has_room else [0.0, goal]
        for value in values:
            if value <= 1.001 * limit or not value:
                y = round(float(self._row(value, limit)))
                color, opacity = (_GRID, 0.5) if value else (INK, 0.9)
                sprite.box(self._left, y - hair, self._right, y, color, opacity)
                text = number(value * factor)
                sprite.text(self._left - 0.4 * em, y + 0.3 * em, text, small, INK, "right")

    def _draw_time_axis(self, sprite: Sprite) -> None:
        """Draw marks at round times, with their labels."""
        em = self._em
        small = round(0.85 * em)
        step = round_up(self._duration / 4, (1.0, 2.0, 5.0))  # [s]
        last = int(self._duration / step + 1e-9)
        for k in range(last + 1):
            x = round(float(self._column(k * step)))
            sprite.box(x, self._bottom, x + self._hair, self._bottom + 0.25 * em, INK)
            text = number(k * step) + (" s" if k == last else "")
            sprite.text(x, self._bottom + 1.25 * em, text, small, INK, "middle")

    def _draw_curve(
        self, sprite: Sprite, times: NDArray, values: NDArray, limit: float, color: Color
    ) -> None:
        """Draw a curve up to its last time, with a disc at its end.

        A single curve has its area filled.
        """
        if len(times) == 0 or limit <= 0:
            return
        end = float(self._column(times[-1]))
        edges = np.arange(self._left, int(np.ceil(end)) + 1)
        rows = np.interp(edges, self._column(times), self._row(values, limit))
        thickness = self._em / 9
        slope = np.hypot(1.0, np.diff(rows))
        low = np.minimum(rows[1:], rows[:-1])
        high = np.maximum(rows[1:], rows[:-1])
        line = overlap(
            low - thickness / 2 * slope**0.5, high + thickness / 2 * slope**0.5, self._height
        )
        under = overlap((low + high) / 2, np.full(len(low), float(self._bottom)), self._height)
        columns = edges[:-1]
        area_coverage = np.zeros((self._height, self._width), np.float32)
        area_coverage[:, columns] = under
        line_coverage = np.zeros((self._height, self._width), np.float32)
        line_coverage[:, columns] = line
        if len(self._names) < 2:
            sprite.fill(area_coverage, color, 0.14)
        sprite.fill(line_coverage, color)
        sprite.disc(end, float(self._row(values[-1], limit)), 0.26 * self._em, color)

    def _column(self, time: ArrayLike) -> NDArray[np.float64]:
        return (
            self._left
            + (self._right - self._left) * np.asarray(time, dtype=np.float64) / self._duration
        )

    def _row(self, value: ArrayLike, limit: float) -> NDArray[np.float64]:
        share = np.asarray(value, dtype=np.float64) / (limit or 1.0)
        return self._bottom - (self._bottom - self._top) * np.clip(share, 0, 1)


def trace_panel(layout: Layout, traces: Sequence[Trace], duration: float) -> Sprite:
    """The signals of sensors over the time of the whole video, one below the other.

    Each has its greatest value beside its name. `duration` is that of the video [s].
    """
    em = layout.em
    small = round(0.85 * em)
    pitch = round(2.4 * em)
    sprite = panel(layout.panel_width(26), round(pitch * len(traces) + 0.5 * em), em)
    left = round(0.7 * em)
    right = sprite.width - round(0.7 * em)
    column_times = np.linspace(0, duration, right - left, endpoint=False)  # [s]
    for index, trace in enumerate(traces):
        top = pitch * index + 0.3 * em
        peak = float(max(-trace.low.min(initial=0.0), trace.high.max(initial=0.0)))
        low, high = _joined_columns(trace, column_times)
        middle = top + 0.64 * pitch
        scale = 0.34 * pitch / (peak or 1.0)  # [pixels] for each unit of the values
        half = em / 18  # of the line's thickness
        line = overlap(middle - scale * high - half, middle - scale * low + half, sprite.height)
        margins = (left, sprite.width - left - len(low))
        sprite.fill(np.pad(line, ((0, 0), margins)), COLORS[0])
        factor, unit = readable(peak or 1.0, trace.unit)
        three_digits = float(f"{peak * factor:.3g}")
        sprite.text(left, top + 0.85 * em, trace.name, small)
        value = f"{number(three_digits)} {unit}"
        sprite.text(right, top + 0.85 * em, value, small, FAINT, "right")
    return sprite


def _joined_columns(
    trace: Trace, column_times: NDArray[np.float64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Least and greatest value of a trace in each column of pixels that it has reached.

    Neighbouring columns overlap, so that the line has no gaps.
    """
    times_so_far = column_times[column_times <= trace.times.max(initial=-1.0)]
    place = np.searchsorted(trace.times, times_so_far, side="right") - 1
    low = trace.low[place]
    high = trace.high[place]
    joined_low = np.minimum(low[1:], high[:-1])
    joined_high = np.maximum(high[1:], low[:-1])
    low[1:] = joined_low
    high[1:] = joined_high
    return low, high
