"""Sprites: coverage, opacity, clipping, text.

Arrows.
"""

from pathlib import Path

import numpy as np
import pytest

from ripple_sim.overlay import marks as patch_module
from ripple_sim.overlay.marks import Sprite, draw_arrow
from ripple_sim.overlay.notes import number


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
    assert Path(patch_module._font(20).path).name == "DejaVuSans.ttf"
    missing = patch_module._font(40).getmask("\U0010ffff").getbbox()
    for sign in number(-1.0)[0], "µ", "\N{MULTIPLICATION SIGN}":
        assert patch_module._font(40).getmask(sign).getbbox() != missing


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
