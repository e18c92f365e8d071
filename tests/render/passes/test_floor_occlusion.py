"""Ambient occlusion of the floor: geoms occlude the sky, sites do not."""

import numpy as np
import pytest
from drawn import FLOOR, FRONT, SIZE, SUN, frame_of

from ripple_sim.render import Camera
from ripple_sim.render.camera import srgb_to_linear


def test_sites_hide_no_sky(gl):
    """Under a wide site the floor stays as light as without it where no lamp shines."""
    roof = '<site type="box" size=".5 .5 .02" pos="0 0 .4" rgba="1 0 0 1"/>'
    light = {"visual": '<headlight ambient=".5 .5 .5" diffuse="0 0 0"/>', "lighting": "model", "camera": FRONT}
    frames = [frame_of(gl, FLOOR + body, **light) for body in (roof, roof.replace("site", "geom"), "")]
    under = np.s_[78:82, 75:85]
    site, geom, none = (frame[under].mean() for frame in frames)
    assert abs(site - none) < 1
    assert geom < none - 10


def test_a_ceiling_has_the_colour_and_the_light_of_the_floor_below(gl):
    """A white plate, seen from below, above a red floor that the sun lights: it sees little else."""
    floor = '<geom type="plane" size="0 0 .1" rgba=".9 .2 .2 1"/>'
    plate = '<geom type="box" size=".2 .2 .01" pos="0 0 .6" rgba="1 1 1 1"/>'
    sun = SUN.format(1.0, "true")
    light = {"visual": '<headlight active="0"/>', "lighting": "model"}
    below = Camera((0.0, 0.0, 0.45), 1.2, 90.0, 12.0, 40.0)
    frame = srgb_to_linear(frame_of(gl, floor + plate + sun, camera=below, **light) / 255)
    ceiling, ground = frame[52:60, 70:90].mean(axis=(0, 1)), frame[-4:].mean(axis=(0, 1))
    assert ceiling[0] > 8 * ceiling[1]
    assert 0.5 * ground[0] < ceiling[0] < ground[0]


def test_a_ball_throws_its_colour_on_the_floor_most_where_it_is_lit(gl):
    """A red ball makes the floor at its foot redder, a black one does not; the sun shines from the left."""
    floor = FLOOR.replace(".8 .8 .8", ".6 .6 .6")
    ball = '<geom type="sphere" size=".3" pos="0 0 .3" rgba="{} 1"/>'
    metre = SIZE[1] / (2 * 4.0 * np.tan(np.radians(20)))
    redder = {}
    for rgba in (".9 .1 .1", ".1 .1 .1"):
        frame = frame_of(gl, floor + ball.format(rgba) + SUN.format(1.0, "true"), lighting="model")
        red, green, _ = np.moveaxis(srgb_to_linear(frame[58:62] / 255), -1, 0)
        for x in (-0.36, 0.36, -1.2):
            column = int(SIZE[0] / 2 + x * metre)
            redder[rgba, x] = (red - green)[:, column - 1 : column + 1].mean()
    assert redder[".9 .1 .1", -0.36] > 0.02
    assert 0.01 < redder[".9 .1 .1", 0.36] < redder[".9 .1 .1", -0.36]
    assert redder[".9 .1 .1", -1.2] == pytest.approx(0.0, abs=0.003)
    assert max(redder[".1 .1 .1", x] for x in (-0.36, 0.36)) < 0.002
