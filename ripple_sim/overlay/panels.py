"""What overlays put on a frame of any size, and where: contact marks, and panels stacked in the corners.

Panels are a bar of colours, a clock, a label, the scale of the arrows, and the plot of energy,
which grows with the video. Contact marks are arrows as long as the impulse is large, projected onto
the frame, and faint where a geom hides them.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.energy import Energy
from ripple_sim.render.pose import Pose
from ripple_sim.scene.overlays import HEATMAPS, Request

from .marks import FAINT, HEAD_WIDTH, INK, RIM, Color, Mark, Sprite, draw_arrow, overlap, text_width
from .notes import Notes, Trace, colors, number, readable, round_up

_SHOWN_GROUPS = np.array([1, 1, 1, 0, 0, 0], np.uint8)
_TOUCHING = 0.004  # a geom in front of a point by this share of the distance does not hide it
_LONGEST = 1.5  # times the scale's arrow; a growing scale lags for a moment
_HIDDEN = 0.3  # opacity behind other geoms
_SAMPLES = 9  # along an arrow, to find its hidden parts
PANEL_OPACITY = 0.86
_PADDING = 0.75  # in ems, as all measures below
COLORS = ((38, 92, 160), (196, 88, 52))  # of the curves
_GRID = (150, 158, 170)
_TITLE = "wave energy"

# height of its line, in ems; the longest of its texts
_LEDGER = 1.3
_LONGEST_ENTRY = "bodies \N{MINUS SIGN}0.88 mJ"


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
        return left, self.margin if "top" in corner else self.height - self.margin - height


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
        self._pose = pose
        self._size = width, height

    def pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels [k, 2] of points [k, 3] in the world: x to the right, y down; NaN behind the camera."""
        pixels, depth = self._pose.pixels(points, self._size)
        return np.where(depth[:, None] > 0, pixels, np.nan)

    def metres(self, point: NDArray[np.float64]) -> float:
        """Length [m] of a pixel at a point's distance."""
        distance = float((self._pose.position - point) @ self._pose.rotation[:, 2])
        return self._pose.pixel_height(distance, self._size[1])

    def seen(self, model: Any, data: Any, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether no geom of a MuJoCo model, its targets undeformed, hides points [k, 3] in the world."""
        ways = self._pose.ways(points)
        hit = np.zeros(1, np.int32)
        reach = np.array(
            [
                mujoco.mj_ray(model, data, point - way, way, _SHOWN_GROUPS, 1, -1, hit)
                for point, way in zip(points, ways, strict=True)
            ]
        )
        return (reach < 0) | (reach > 1 - _TOUCHING)


# an arrow on a frame: tip and tail [pixels], and the opacity along it
PlacedMark: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def place_marks(
    marks: Sequence[Mark],
    scale: float,
    layout: Layout,
    projection: Projection,
    model: Any,
    data: Any,
) -> list[PlacedMark]:
    """Place contact marks on a frame.

    Arrows stand on the surface, in perspective except for their size, the same at any distance.
    Hidden parts are faint.

    Parameters
    ----------
    marks : sequence of Mark
    scale : float
        Impulse [N s] of an arrow of length `Layout.arrow_length`, seen from the side.
    projection : Projection
        Of this frame.
    model, data : mujoco.MjModel, mujoco.MjData
        Whose geoms may hide the arrows.
    """
    placed = []
    for mark in marks:
        length = (
            layout.arrow_length
            * projection.metres(mark.point)
            * min(mark.impulse / scale, _LONGEST)
        )
        points = mark.point + length * np.linspace(0, 1, _SAMPLES)[:, None] * mark.axis
        pixels = projection.pixels(points)
        if np.isfinite(pixels).all():
            opacity = mark.opacity * np.where(projection.seen(model, data, points), 1.0, _HIDDEN)
            placed.append((pixels[0], pixels[-1], opacity))
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


def panel(width: int, height: int, em: int) -> Sprite:
    """An empty panel."""
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
    """The arrow of the impulse `goal` / 2 [N s], as long as in the scene under `scale`, and its value."""
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


Curve = tuple[NDArray[np.float64], NDArray[np.float64]]  # times [s], values


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
        self._has_ledger = (
            ledger and text_width(_LONGEST_ENTRY, round(0.85 * em)) + 0.4 * em < self._column_width
        )
        line = round(_LEDGER * em) if self._has_ledger else 0
        self._height = round(min(8.6 * em, 0.38 * layout.height)) + line
        self._left = round(3.6 * em)
        self._right = self._width - round(1.1 * em)
        self._top = round(2.4 * em) + line
        self._bottom = self._height - round(1.95 * em)
        self._axes = functools.lru_cache(maxsize=1)(self._draw_axes)

    def draw(
        self, curves: Sequence[Curve], limit: float, goal: float, ledger: Energy | None = None
    ) -> Sprite:
        """Draw curves up to the present, from 0 to `limit`, with labels at half and whole of `goal`, and a ledger."""
        sprite = copy.deepcopy(self._axes(limit, goal))
        for color, (times, values) in zip(COLORS, curves, strict=False):
            self._draw_curve(sprite, times, values, limit, color)
        if ledger is None or not self._has_ledger:
            return sprite
        size = round(0.85 * self._em)
        inks = {"bodies": INK, "waves": COLORS[0], "total": INK}
        for column, (name, ink) in enumerate(inks.items()):
            value = getattr(ledger, name)
            factor, unit = readable(abs(value), "J") if value else (1.0, "J")
            x = 0.7 * self._em + column * self._column_width
            sprite.text(x, 2.75 * self._em, name, size, FAINT if ink == INK else ink)
            x += text_width(name, size) + 0.4 * self._em
            sprite.text(
                x, 2.75 * self._em, f"{number(float(f'{factor * value:.3g}'))} {unit}", size, ink
            )
        return sprite

    def _draw_axes(self, limit: float, goal: float) -> Sprite:
        em = self._em
        small = round(0.85 * self._em)
        factor, prefixed = readable(goal, "J") if goal else (1.0, "J")
        sprite = panel(self._width, self._height, em)
        sprite.text(round(0.7 * em), 1.4 * em, _TITLE, em)
        sprite.text(
            round(0.7 * em) + text_width(_TITLE, em) + 0.5 * em, 1.4 * em, prefixed, small, FAINT
        )
        x = float(self._width - round(0.7 * em))
        titles = text_width(f"{_TITLE} J", em) + em
        # where there is no room for the names, the runs' titles have the curves' colours anyway
        if sum(text_width(name, small) + 0.9 * em for name in self._names) <= x - titles:
            for color, name in reversed(list(zip(COLORS, self._names, strict=False))):
                sprite.text(x, 1.4 * em, name, small, color, "right")
                x -= text_width(name, small) + 0.9 * em
        hair = max(1, round(em / 16))
        half = [goal / 2] if self._bottom - self._top > 2.6 * small else []
        for value in [0.0, *half, goal] if goal else [0.0]:
            if value <= 1.001 * limit or not value:
                y = round(float(self._row(value, limit)))
                sprite.box(
                    self._left,
                    y - hair,
                    self._right,
                    y,
                    INK if not value else _GRID,
                    0.9 if not value else 0.5,
                )
                sprite.text(
                    self._left - 0.4 * em, y + 0.3 * em, number(value * factor), small, INK, "right"
                )
        step = round_up(self._duration / 4, (1.0, 2.0, 5.0))
        last = int(self._duration / step + 1e-9)
        for k in range(last + 1):
            x = round(float(self._column(k * step)))
            sprite.box(x, self._bottom, x + hair, self._bottom + 0.25 * em, INK)
            text = number(k * step) + (" s" if k == last else "")
            sprite.text(x, self._bottom + 1.25 * em, text, small, INK, "middle")
        return sprite

    def _draw_curve(
        self, sprite: Sprite, times: NDArray, values: NDArray, limit: float, color: Color
    ) -> None:
        if len(times) == 0 or limit <= 0:
            return
        end = float(self._column(times[-1]))
        edges = np.arange(self._left, int(np.ceil(end)) + 1)
        rows = np.interp(edges, self._column(times), self._row(values, limit))
        thick = self._em / 9
        slope = np.hypot(1.0, np.diff(rows))
        low = np.minimum(rows[1:], rows[:-1])
        high = np.maximum(rows[1:], rows[:-1])
        line = overlap(low - thick / 2 * slope**0.5, high + thick / 2 * slope**0.5, self._height)
        under = overlap((low + high) / 2, np.full(len(low), float(self._bottom)), self._height)
        coverage = np.zeros((2, self._height, self._width), np.float32)
        coverage[:, :, edges[:-1]] = under, line
        if len(self._names) < 2:
            sprite.fill(coverage[0], color, 0.14)
        sprite.fill(coverage[1], color)
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
    """The signals of sensors over the time of the whole video, one below the other, each with its greatest value."""
    em = layout.em
    small = round(0.85 * layout.em)
    pitch = round(2.4 * layout.em)
    sprite = panel(layout.panel_width(26), round(pitch * len(traces) + 0.5 * em), em)
    left = round(0.7 * em)
    right = sprite.width - round(0.7 * em)
    for number_of, (name, times, low, high, unit) in enumerate(traces):
        top = pitch * number_of + 0.3 * em
        peak = float(max(-low.min(initial=0.0), high.max(initial=0.0)))
        at = np.linspace(0, duration, right - left, endpoint=False)
        place = np.searchsorted(times, at[at <= times.max(initial=-1.0)], side="right") - 1
        low = low[place]
        high = high[place]
        low[1:], high[1:] = np.minimum(low[1:], high[:-1]), np.maximum(high[1:], low[:-1])  # joined
        middle = top + 0.64 * pitch
        scale = 0.34 * pitch / (peak or 1.0)
        thick = em / 18
        line = overlap(middle - scale * high - thick, middle - scale * low + thick, sprite.height)
        sprite.fill(np.pad(line, ((0, 0), (left, sprite.width - left - len(low)))), COLORS[0])
        factor, prefixed = readable(peak or 1.0, unit)
        value = f"{number(float(f'{peak * factor:.3g}'))} {prefixed}"
        sprite.text(left, top + 0.85 * em, name, small)
        sprite.text(right, top + 0.85 * em, value, small, FAINT, "right")
    return sprite


class Painter:
    """Draws the requested panels.

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
            offset = 0
            for sprite in panels:
                left, top = self._layout.place(corner, sprite.width, sprite.height)
                sprite.over(frame, left, top + (offset if "top" in corner else -offset))
                offset += sprite.height + self._layout.margin // 2

    def _panels(self, notes: Notes) -> dict[str, list[Sprite]]:
        """Panels by corner, those nearest to the frame's border first."""
        request = self._request
        layout = self._layout
        em = self._layout.em
        corners: dict[str, list[Sprite]] = {
            name: [] for name in ("top left", "top", "top right", "bottom left", "bottom right")
        }
        for corner, title, color in zip(
            ("top left", "top right"), self._titles, COLORS, strict=False
        ):
            named = self._label(title[0], em, title[1], color)
            if named.width > self._title_width:
                named = self._label(title[0], em, "", color)
            corners[corner].append(named)
        if request.time:
            clock = label(f"t = {notes.time:.{self._decimals}f} s", em)
            corners["top" if self._titles else "top left"].append(clock)
        if request.grid and self._spacing:
            cells = f"{self._spacing} \N{MULTIPLICATION SIGN} {self._spacing} texels"
            corners["top left"].append(self._label("grid", em, cells))
        if request.contacts and notes.mark_scale[0] > 0:
            corners["top right"].append(self._key(layout, *notes.mark_scale))
        if request.heatmap:
            bar = self._bar(
                layout, request.heatmap, HEATMAPS[request.heatmap], *notes.heatmap_scale
            )
            corners["bottom left"].append(bar)
        if request.sensors and notes.traces:
            corners["bottom right"].append(trace_panel(layout, notes.traces, self._duration))
        if request.energy:
            ledger = None if self._titles or not notes.ledgers else notes.ledgers[0]
            corners["bottom right"].append(
                self._energy_plot.draw(notes.energies, *notes.energy_scale, ledger)
            )
        return corners
