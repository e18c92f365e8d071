"""Panels appear as requested, where they belong, and leave the rest of the frame alone.

The plot of energy over time.
"""

import numpy as np
import pytest

from ripple_sim.overlay.notes import Notes, Scale
from ripple_sim.overlay.painter import EnergyPlot, Painter
from ripple_sim.overlay.panels import Layout
from ripple_sim.scene.scene import parse_request

SIZE = (640, 360)
CURVE = (np.linspace(0, 1, 9), np.ones(9))
CORNERS = {"time": "top left", "grid": "top left", "contacts": "top right", "height": "bottom left",
           "energy": "bottom right"}  # fmt: skip


def notes(time: float = 1.0, marks: float = 1.0) -> Notes:
    one = Scale(1.0, 1.0)
    return Notes(time, [], one, [], Scale(marks, marks), [CURVE], one)


def painted(words: list[str], content: Notes, channels: int = 3, **options: object) -> np.ndarray:
    frame = np.full((*SIZE[::-1], channels), 90, np.uint8)
    Painter(parse_request(words), Layout(*SIZE), **{"duration": 5.0, "spacing": 8, **options}).paint(frame, content)
    return frame


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("word", CORNERS)
def test_an_overlay_is_drawn_in_its_own_corner(word: str, channels: int) -> None:
    rows, columns = np.nonzero((painted([word], notes(), channels) != 90).any(axis=-1))
    corner = CORNERS[word]
    assert len(rows) > 500
    assert rows.max() < SIZE[1] / 2 if "top" in corner else rows.min() > SIZE[1] / 2
    assert columns.max() < SIZE[0] / 2 if "left" in corner else columns.min() > SIZE[0] / 2


def test_all_together_are_those_in_other_corners_alone() -> None:
    everything = painted(["contacts", "height", "energy", "time"], notes())
    for word in ("contacts", "height", "energy", "time"):
        alone = painted([word], notes())
        there = (alone != 90).any(axis=-1)
        np.testing.assert_array_equal(everything[there], alone[there])


@pytest.mark.parametrize(
    ("words", "options", "content"),
    [([], {}, notes()), (["grid"], {"spacing": 0}, notes()), (["contacts"], {}, notes(marks=0.0))],
    ids=["no request", "grids that differ", "no contact yet"],
)
def test_nothing_is_drawn_where_there_is_nothing_to_tell(words: list[str], options: dict, content: Notes) -> None:
    assert (painted(words, content, **options) == 90).all()


@pytest.mark.parametrize(("duration", "same"), [(5.0, False), (500.0, True)])
def test_the_clock_of_a_long_video_has_fewer_decimals(duration: float, same: bool) -> None:
    one, other = (painted(["time"], notes(time), duration=duration) for time in (1.61, 1.64))
    assert np.array_equal(one, other) is same


def test_panels_of_one_corner_lie_below_one_another() -> None:
    both, clock = painted(["time", "grid"], notes()), painted(["time"], notes())
    under = np.nonzero((both != clock).any(axis=(1, 2)))[0]
    assert under.min() > np.nonzero((clock != 90).any(axis=(1, 2)))[0].max()


def test_energy_plot_draws_values_at_their_height() -> None:
    layout = Layout(1280, 720)
    plot = EnergyPlot(layout, "energy", "J", 10.0)
    times = np.linspace(0, 10, 300)

    def row_of(value: float) -> float:
        frame = np.full((400, 400, 3), 255, np.uint8)
        plot.draw([(times, np.full(300, value))], 2.0, 2.0).over(frame, 0, 0)
        blue = (frame[..., 2].astype(int) - frame[..., 0]) > 80
        return float(np.flatnonzero(blue[:, 200]).mean())

    low, middle, high = row_of(0.5), row_of(1.0), row_of(1.5)
    assert low > middle > high
    assert low - middle == pytest.approx(middle - high, abs=1.0)


def test_energy_plot_grows_with_time() -> None:
    layout = Layout(1280, 720)
    plot = EnergyPlot(layout, "energy", "J", 10.0)

    def reach(until: float) -> int:
        times = np.linspace(0, until, 50)
        frame = np.full((400, 400, 3), 255, np.uint8)
        plot.draw([(times, np.ones(50))], 2.0, 2.0).over(frame, 0, 0)
        blue = (frame[..., 2].astype(int) - frame[..., 0]) > 80
        return int(np.flatnonzero(blue.any(axis=0)).max())

    quarter, half, whole = reach(2.5), reach(5.0), reach(10.0)
    assert half - quarter == pytest.approx((whole - quarter) / 3, abs=1.5)
