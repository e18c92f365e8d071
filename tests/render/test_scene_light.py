"""What lights a scene: the lights and skybox of the MJCF, or the studio."""

import numpy as np
import pytest
from drawn import BALL, FLOOR, FRONT, SPOT, SUN, frame_of

from ripple_sim.solver import RippleError


def test_no_light_in_the_mjcf_means_the_studio_and_both_can_be_asked_for(gl):
    dark = "<headlight active='0'/>"
    sun = SUN.format(1.0, "true")
    np.testing.assert_array_equal(frame_of(gl, FLOOR + BALL), frame_of(gl, FLOOR + BALL, lighting="studio"))
    np.testing.assert_array_equal(frame_of(gl, FLOOR + BALL + sun), frame_of(gl, FLOOR + BALL + sun, lighting="model"))
    assert frame_of(gl, FLOOR + BALL, visual=dark, lighting="model").mean() < 40
    with pytest.raises(RippleError, match=r"'dusk'.*'auto', 'model', 'studio'"):
        frame_of(gl, FLOOR, lighting="dusk")


def test_a_scene_lit_by_a_spot_alone_is_dark_all_round(gl):
    spot = SPOT.format(0.0, 0.0).replace('exponent="1"', 'exponent="20"')
    dark = frame_of(gl, FLOOR + BALL + spot, visual='<headlight active="0"/>', camera=FRONT)
    light = frame_of(gl, FLOOR + BALL + SUN.format(0.0, "true"), visual='<headlight active="0"/>', camera=FRONT)
    assert dark[:10].mean() < 20 < 80 < light[:10].mean()
    assert dark.max() > 100


def test_skybox_fills_the_background(gl):
    sky = '<texture type="skybox" builtin="flat" rgb1=".1 .2 .9" width="16" height="96"/>'
    frame = frame_of(gl, SUN.format(0.0, "true"), asset=sky, camera=FRONT)
    # bright colours pale a little
    np.testing.assert_allclose(frame.mean(axis=(0, 1)), 255 * np.array([0.1, 0.2, 0.9]), atol=12)
    assert frame.std(axis=(0, 1)).max() < 1
