"""Sizes of the overlays follow the frame's, and panels stay inside it."""

import pytest

from ripple_sim.overlay.panels import Layout

SIZES = [(320, 180), (640, 360), (1280, 720), (720, 1280), (3840, 2160)]


def test_a_frame_of_twice_the_size_has_everything_twice_as_large() -> None:
    one, two = Layout(1280, 720), Layout(2560, 1440)
    assert (one.scale, one.em) == (1.0, 16)
    for name in ("scale", "em", "arrow_length", "arrow_thickness"):
        assert getattr(two, name) == pytest.approx(2 * getattr(one, name))
    assert Layout(720, 1280).scale == one.scale  # upright frames alike


def test_type_and_arrows_stay_readable_on_small_frames() -> None:
    assert Layout(64, 48).em == 9
    assert Layout(64, 48).arrow_thickness == 1.3


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("ems", [4, 16, 100])
def test_two_panels_fit_side_by_side(size: tuple[int, int], ems: float) -> None:
    layout = Layout(*size)
    width = layout.panel_width(ems)
    assert 2 * width + 3 * layout.margin <= size[0]
    assert 0 < width <= ems * layout.em + 0.5


@pytest.mark.parametrize("size", SIZES)
def test_opposite_corners_mirror_each_other(size: tuple[int, int]) -> None:
    layout, (width, height) = Layout(*size), (50, 20)
    left, top = layout.place("top left", width, height)
    assert (left, top) == (layout.margin, layout.margin)
    assert layout.place("bottom right", width, height) == (size[0] - width - left, size[1] - height - top)
    assert layout.place("bottom left", width, height) == (left, size[1] - height - top)
    middle, _ = layout.place("top", width, height)
    assert abs(middle - (size[0] - width - middle)) <= 1
