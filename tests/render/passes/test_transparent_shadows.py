"""Shadows of what is transparent: lighter, without a pattern, and with the shadows of what lies under it."""

import numpy as np
import pytest
from drawn import FLOOR, SIZE, SUN, ball_surface, frame_of
from scipy.ndimage import distance_transform_edt

from ripple_sim.render.contract import srgb_to_linear

PIXELS = SIZE[1] / (2 * 4.0 * np.tan(np.radians(20)))  # a metre, seen from above
DARK_FLOOR = FLOOR.replace(".8 .8 .8", ".6 .6 .6")  # below the shoulder of the tone mapping
PLATE = '<geom type="box" size=".3 .3 .01" pos="-1 0 1" rgba=".5 .5 .5 {}"/>'


def floor_at(frame, x, y=0.0, half=2):
    """Linear light of the floor about a point [m], [2 half, 2 half, 3]."""
    column, row = int(SIZE[0] / 2 + x * PIXELS), int(SIZE[1] / 2 - y * PIXELS)
    return srgb_to_linear(frame[row - half : row + half, column - half : column + half] / 255)


@pytest.mark.parametrize("opacity", [0.2, 0.5, 0.8])
def test_a_transparent_geom_takes_its_opacity_of_the_light(gl, opacity):
    """A plate 1 m up throws its shadow 1 m to the right."""
    shaded, full = (frame_of(gl, DARK_FLOOR + PLATE.format(each) + SUN.format(1.0, "true")) for each in (opacity, 1.0))
    plain = frame_of(gl, DARK_FLOOR + PLATE.format(1.0) + SUN.format(1.0, "false"))
    open_floor, under, dark = (floor_at(frame, 0.0) for frame in (plain, shaded, full))
    share = (open_floor - under).mean() / (open_floor - dark).mean()
    assert share == pytest.approx(opacity, abs=0.05)
    assert np.ptp(under, axis=(0, 1)).max() < 0.02  # no pattern


def test_a_body_under_glass_keeps_its_shadow(gl):
    """A small plate under a large pane: its shadow is as dark as without the pane, the pane's lighter about it."""
    body = '<geom type="box" size=".1 .3 .01" pos="-.2 0 .4" rgba=".5 .5 .5 1"/>'
    bare, covered = (
        frame_of(gl, DARK_FLOOR + body + pane + SUN.format(1.0, "true")) for pane in ("", PLATE.format(0.4))
    )
    np.testing.assert_allclose(floor_at(covered, 0.2, half=1), floor_at(bare, 0.2, half=1), atol=0.02)


def test_water_is_a_lens(gl):
    """Its shadow is dark towards the rim; the light in the middle has its colour."""
    body = '<geom name="b" type="sphere" size=".5" pos="-1 0 1"/>' + DARK_FLOOR + SUN.format(1.0, "{}")
    plain, water, clay = (
        frame_of(gl, body.format(flag), targets={"b": ball_surface(look)})
        for flag, look in (("false", "clay"), ("true", "water"), ("true", "clay"))
    )
    open_floor, middle, dark = (floor_at(frame, 0.0) for frame in (plain, water, clay))
    rim = floor_at(water, 0.0, 0.4)
    assert (rim - dark).max() < 0.3 * (open_floor - dark).max()
    assert (middle[..., 1] - dark[..., 1]).min() > 0.5 * (open_floor - dark).max()
    assert middle[..., 0].mean() < 0.7 * middle[..., 2].mean()


def test_no_light_is_taken_beside_a_penumbra(gl):
    """Where a box's shadow shows, what is plainly shaded is a few pixels away."""
    box = '<geom type="box" size=".5 .5 .5" pos="-.5 .2 .5" euler="0 0 40" rgba=".9 .1 .2 .4"/>'
    shaded, plain = (
        frame_of(gl, DARK_FLOOR + box + SUN.format(1.0, flag), size=(320, 240)) for flag in ("true", "false")
    )
    taken = (plain - shaded).max(axis=2)
    assert distance_transform_edt(taken < 5)[taken >= 2].max() < 6


def test_a_wide_penumbra_has_no_pattern_where_blocks_of_the_floor_are_interpolated(gl):
    body = '<geom name="b" type="sphere" size=".5" pos="0 0 1.5"/>' + DARK_FLOOR
    frame = frame_of(gl, body, targets={"b": ball_surface("water")}, lighting="studio", size=(1280, 960))
    across = frame[480, 920:1240, 1]
    assert np.ptp(across) > 50
    assert np.abs(np.diff(across, 2)).max() <= 2
