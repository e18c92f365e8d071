"""The surface of a target: its look."""

import numpy as np
import pytest
from drawn import FRONT, ball_surface, frame_of

from ripple_sim.render import LOOKS
from ripple_sim.solver import RippleError


def test_the_model_look_takes_the_material_of_the_geom(gl):
    asset = '<material name="green" rgba="0 .8 0 1"/>'
    body = '<geom name="t" type="sphere" size=".5" pos="0 0 .5" material="green"/>'
    middle = np.s_[55:65, 75:85]
    shown = frame_of(gl, body, asset=asset, camera=FRONT, targets={"t": ball_surface("model")})[middle].mean(
        axis=(0, 1)
    )
    assert shown[1] > shown[0] + 60
    assert shown[1] > shown[2] + 60


def test_unknown_look_names_the_valid_ones(gl):
    with pytest.raises(RippleError, match="'chrome'.*" + ".*".join(LOOKS)):
        frame_of(gl, '<geom name="t" type="sphere" size=".5"/>', targets={"t": ball_surface("chrome")})
