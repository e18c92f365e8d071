"""Ambient occlusion of the floor: geoms occlude the sky, sites do not."""

import numpy as np
from drawn import FLOOR, FRONT, SUN, frame_of

from ripple_sim.render import Camera
from ripple_sim.render.color import srgb_to_linear


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
