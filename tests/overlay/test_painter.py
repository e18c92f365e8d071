"""Sprites, arrows and panels: coverage, opacity, clipping, text, and their places."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.coupling import Energy
from ripple_sim.overlay import (
    EnergyPlot,
    Layout,
    Notes,
    Painter,
    Sprite,
    draw_arrow,
    number,
    sprite as sprite_module,
)
from ripple_sim.scene import parse_request

SIZE = (640, 360)
GREY = 90  # of an empty frame
CURVE = (np.linspace(0, 1, 9), np.ones(9))
CORNERS = {
    "time": "top left",
    "grid": "top left",
    "contacts": "top right",
    "height": "bottom left",
    "energy": "bottom right",
}


def test_sprite_covers_in_proportion() -> None:
    sprite = Sprite(10, 6)
    sprite.box(2.25, 1.0, 5.5, 2.5, (255, 255, 255))
    frame = np.zeros((6, 10, 3), np.uint8)
    sprite.over(frame, 0, 0)
    np.testing.assert_array_equal(frame[1, :, 0], [0, 0, 191, 255, 255, 128, 0, 0, 0, 0])
    np.testing.assert_array_equal(frame[2, 3:5, 0], [128, 128])
    assert frame[3:].max() == 0


def test_sprite_over_a_transparent_frame() -> None:
    sprite = Sprite(3, 1)
    sprite.box(0, 0, 3, 1, (200, 100, 0), 0.5)
    frame = np.zeros((1, 3, 4), np.uint8)
    frame[0, 1:] = (0, 0, 80, 255), (0, 0, 80, 51)
    sprite.over(frame, 0, 0)
    np.testing.assert_array_equal(frame[0, 0], (200, 100, 0, 128))  # the sprite's own
    np.testing.assert_array_equal(frame[0, 1], (100, 50, 40, 255))  # half and half
    # shares of 0.5 and 0.2 * 0.5 of what is seen, over an opacity of 0.6
    np.testing.assert_allclose(frame[0, 2], (200 * 5 / 6, 100 * 5 / 6, 80 / 6, 0.6 * 255), atol=1)


@pytest.mark.parametrize("place", [(-6, -3), (95, 45), (200, 10), (40, -60)])
def test_sprite_over_the_border_is_cut(place: tuple[int, int]) -> None:
    sprite = Sprite(12, 8)
    sprite.box(0, 0, 12, 8, (200, 100, 50))
    frame = np.zeros((50, 100, 3), np.uint8)
    sprite.over(frame, *place)
    x, y = place
    expected = np.zeros_like(frame)
    expected[max(y, 0) : max(y + 8, 0), max(x, 0) : max(x + 12, 0)] = (200, 100, 50)
    np.testing.assert_array_equal(frame, expected)


def test_number_is_written_in_a_font_that_has_its_signs() -> None:
    assert Path(sprite_module._font(20).path).name == "DejaVuSans.ttf"
    missing = sprite_module._font(40).getmask("\U0010ffff").getbbox()
    for sign in number(-1.0)[0], "µ", "\N{MULTIPLICATION SIGN}":
        assert sprite_module._font(40).getmask(sign).getbbox() != missing


def test_arrow_has_its_length_and_fades() -> None:
    sprite = Sprite(120, 60)
    draw_arrow(sprite, (100.0, 30.0), (20.0, 30.0), 4.0, [1.0, 1.0, 0.0, 0.0])
    frame = np.full((60, 120, 3), 255, np.uint8)
    sprite.over(frame, 0, 0)
    dark = 255 - frame[30, :, 0].astype(int)
    assert dark[100] > 200  # the tip's dot
    assert dark[70:95].min() > 200
    assert dark[20:40].max() == 0  # towards the tail nothing is seen
    assert dark[110:].max() == 0


def notes(time: float = 1.0, marks: float = 1.0) -> Notes:
    scale = 1.0, 1.0
    return Notes(time, [], scale, [], (marks, marks), [CURVE], scale)


def painted(words: list[str], content: Notes, channels: int = 3, **options: object) -> np.ndarray:
    width, height = SIZE
    frame = np.full((height, width, channels), GREY, np.uint8)
    settings = {"duration": 5.0, "spacing": 8, **options}
    Painter(parse_request(words), Layout(*SIZE), **settings).paint(frame, content)
    return frame


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("word", CORNERS)
def test_an_overlay_is_drawn_in_its_own_corner(word: str, channels: int) -> None:
    is_painted = (painted([word], notes(), channels) != GREY).any(axis=-1)
    rows, columns = np.nonzero(is_painted)
    corner = CORNERS[word]
    width, height = SIZE
    assert len(rows) > 500
    assert rows.max() < height / 2 if "top" in corner else rows.min() > height / 2
    assert columns.max() < width / 2 if "left" in corner else columns.min() > width / 2


def test_all_overlays_together_look_like_each_alone() -> None:
    everything = painted(["contacts", "height", "energy", "time"], notes())
    for word in ("contacts", "height", "energy", "time"):
        alone = painted([word], notes())
        there = (alone != GREY).any(axis=-1)
        np.testing.assert_array_equal(everything[there], alone[there])


@pytest.mark.parametrize(
    ("words", "options", "content"),
    [([], {}, notes()), (["grid"], {"spacing": 0}, notes()), (["contacts"], {}, notes(marks=0.0))],
    ids=["no request", "grids that differ", "no contact yet"],
)
def test_overlays_without_data_are_not_drawn(
    words: list[str], options: dict, content: Notes
) -> None:
    assert (painted(words, content, **options) == GREY).all()


@pytest.mark.parametrize(("duration", "same"), [(5.0, False), (500.0, True)])
def test_the_clock_of_a_long_video_has_fewer_decimals(duration: float, same: bool) -> None:
    one = painted(["time"], notes(1.61), duration=duration)
    other = painted(["time"], notes(1.64), duration=duration)
    assert np.array_equal(one, other) is same


def test_panels_of_one_corner_lie_below_one_another() -> None:
    both = painted(["time", "grid"], notes())
    clock = painted(["time"], notes())
    rows_of_grid = np.flatnonzero((both != clock).any(axis=(1, 2)))
    rows_of_clock = np.flatnonzero((clock != GREY).any(axis=(1, 2)))
    assert rows_of_grid.min() > rows_of_clock.max()


def test_energy_plot_draws_values_at_their_height_and_grows_with_time() -> None:
    plot = EnergyPlot(Layout(1280, 720), 10.0)

    def curve(value: float, until: float) -> np.ndarray:
        """Pixels that are blue, under a value that holds until a time."""
        frame = np.full((400, 400, 3), 255, np.uint8)
        plot.draw([(np.linspace(0, until, 300), np.full(300, value))], 2.0, 2.0).over(frame, 0, 0)
        return (frame[..., 2].astype(int) - frame[..., 0]) > 80

    def row_of(value: float) -> float:
        return float(np.flatnonzero(curve(value, until=10.0)[:, 200]).mean())

    def last_column_at(time: float) -> int:
        return int(np.flatnonzero(curve(1.0, until=time).any(axis=0)).max())

    low = row_of(0.5)
    middle = row_of(1.0)
    high = row_of(1.5)
    assert low > middle > high  # rows are counted from above
    assert low - middle == pytest.approx(middle - high, abs=1.0)  # a pixel
    quarter = last_column_at(2.5)
    half = last_column_at(5.0)
    whole = last_column_at(10.0)
    assert half - quarter == pytest.approx((whole - quarter) / 3, abs=1.5)  # pixels


def test_the_energy_ledger_is_drawn_for_one_run_only() -> None:
    plain = notes()
    content = dataclasses.replace(notes(), ledgers=[Energy(2.0, 1.0)])
    other = dataclasses.replace(content, ledgers=[Energy(2.0, 3.0)])
    one = painted(["energy"], content)
    two = painted(["energy"], other)
    assert (one != two).any()
    assert (one != painted(["energy"], plain)).any()
    titles = [("one", ""), ("two", "")]
    np.testing.assert_array_equal(
        painted(["energy"], content, titles=titles), painted(["energy"], other, titles=titles)
    )
