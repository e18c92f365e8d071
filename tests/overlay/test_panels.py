"""Panels fit, and their type stays inside and apart."""

import itertools

import numpy as np
import pytest

from ripple_sim.overlay.marks import Sprite, text_width
from ripple_sim.overlay.notes import TITLES, Notes, Scale, colors
from ripple_sim.overlay.painter import EnergyPlot, Painter
from ripple_sim.overlay.panels import Layout, arrow_key, color_bar, label
from ripple_sim.scene.scene import NAMES, parse_request

SIZES = [(320, 180), (640, 360), (720, 1280), (1280, 720), (3840, 2160)]


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, float, float, float, Sprite]]:
    """Boxes (left, top, right, bottom) of everything that is written, and the sprite that it is written on."""
    boxes = []
    plain = Sprite.text

    def text(self: Sprite, x: float, y: float, text: str, size: int, *style: object) -> None:
        align = style[1] if len(style) > 1 else "left"
        width = text_width(text, size)
        left = x - {"left": 0.0, "middle": 0.5, "right": 1.0}[str(align)] * width
        boxes.append((left, y - 0.75 * size, left + width, y + 0.24 * size, self))
        plain(self, x, y, text, size, *style)

    monkeypatch.setattr(Sprite, "text", text)
    return boxes


def all_panels(layout: Layout) -> dict[str, Sprite]:
    times = np.linspace(0, 3, 200)
    plot = EnergyPlot(layout, "wave energy", "J", 4.0, ["ripple-sim", "Dynamic Paint"])
    return {
        "top left": label("t = 12.34 s", layout.em, "slow"),
        "top right": arrow_key(layout, 0.05, 0.05),
        "bottom left": color_bar(layout, "velocity", "m/s", 0.5, 0.5),
        "bottom right": plot.draw([(times, np.sin(times) ** 2)] * 2, 1.0, 1.0),
    }


@pytest.mark.parametrize("size", SIZES)
def test_panels_and_their_type_stay_inside_and_apart(size: tuple[int, int], written: list) -> None:
    layout = Layout(*size)
    taken = np.zeros(size[::-1], int)
    for corner, panel in all_panels(layout).items():
        left, top = layout.place(corner, panel.width, panel.height)
        assert left >= 0
        assert top >= 0
        assert left + panel.width <= size[0]
        assert top + panel.height <= size[1]
        taken[top : top + panel.height, left : left + panel.width] += 1
    assert taken.max() == 1
    assert len(written) > 12
    for left, top, right, bottom, panel in written:
        assert left >= 0
        assert top >= 0
        assert right <= panel.width
        assert bottom <= panel.height
    assert layout.em >= 9


@pytest.mark.parametrize("size", [(320, 180), (1280, 720)])
def test_a_comparison_fits(size: tuple[int, int], written: list) -> None:
    titles = [TITLES["fem"], TITLES["dynamic-paint"]]
    painter = Painter(parse_request(NAMES[1:]), Layout(*size), duration=5.0, spacing=8, titles=titles)
    curve = np.linspace(0, 5, 9), np.ones(9)
    scale = Scale(1.0, 1.0)
    panels = painter._panels(Notes(1.0, [], scale, [], scale, [curve, curve], scale))
    left, middle, right = (panels[corner][0].width for corner in ("top left", "top", "top right"))
    assert max(left, right) + middle / 2 < size[0] / 2 - Layout(*size).margin
    assert panels["bottom left"][0].width + panels["bottom right"][0].width < size[0]
    plot = panels["bottom right"][0]
    heading = [box for box in written if box[4].height == plot.height and box[3] < 2 * Layout(*size).em]
    lines = sorted(box[:3:2] for box in heading)
    assert len(lines) == (2 if size[0] < 400 else 4)  # title, unit, and the names where there is room
    for (_, end), (begin, _) in itertools.pairwise(lines):
        assert end < begin


@pytest.mark.parametrize("size", [(16, 16), (32, 400), (400, 32), (160, 90)])
def test_a_tiny_frame_has_no_panels(size: tuple[int, int]) -> None:
    frame = np.zeros((*size[::-1], 3), np.uint8)
    scale = Scale(1.0, 1.0)
    Painter(parse_request(["time"]), Layout(*size), duration=5.0).paint(
        frame, Notes(1, [], scale, [], scale, [], scale)
    )
    assert not frame.any()


@pytest.mark.parametrize("size", SIZES)
def test_numbers_on_an_axis_do_not_touch(size: tuple[int, int], written: list) -> None:
    color_bar(Layout(*size), "height", "m", 0.0125, 0.0125)
    rows: dict[float, list[tuple[float, float]]] = {}
    for left, _, right, bottom, _panel in written:
        rows.setdefault(bottom, []).append((left, right))
    assert max(map(len, rows.values())) == 5
    for row in rows.values():
        row.sort()
        for (_, end), (begin, _) in itertools.pairwise(row):
            assert end < begin


def test_bar_has_the_colors_of_its_values() -> None:
    layout = Layout(1280, 720)
    bar = color_bar(layout, "height", "m", 0.02, 0.02)
    frame = np.zeros((bar.height, bar.width, 3), np.uint8)
    bar.over(frame, 0, 0)
    row = frame[round(2.25 * layout.em)].astype(int)
    for value in (-0.02, -0.01, 0.0, 0.005, 0.0199):
        expected = colors(value, 0.02).astype(int)
        nearest = np.abs(row - expected).max(axis=1)
        assert nearest.min() <= 2
    middle = np.abs(row - colors(0.0, 0.02).astype(int)).sum(axis=1)
    assert abs(int(np.argmin(middle)) - bar.width / 2) < 3
