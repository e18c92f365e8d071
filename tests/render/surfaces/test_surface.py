"""The surface of a target: its look."""

import mujoco
import numpy as np
import pytest
from drawn import FRONT, ball_surface, frame_of

from ripple_sim.render import LOOKS
from ripple_sim.render.surfaces.surface import target_color
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


@pytest.mark.parametrize(
    ("geom", "given", "shown"),
    [
        ("", None, LOOKS["jelly"].color),
        ('rgba="0.1 0.2 0.3 1"', None, (0.1, 0.2, 0.3)),
        ('material="green"', None, (0.0, 0.8, 0.0)),
        ('material="green" rgba="0.1 0.2 0.3 1"', None, (0.1, 0.2, 0.3)),
        ('material="checked"', None, LOOKS["jelly"].color),
        ('rgba="0.1 0.2 0.3 1"', (0.9, 0.8, 0.7), (0.9, 0.8, 0.7)),
        ('material="checked"', (0.9, 0.8, 0.7), (0.9, 0.8, 0.7)),
    ],
)
def test_a_colour_is_the_given_one_or_the_models_or_the_looks(geom, given, shown):
    """A video once took the look's colour where a loop of one's own took the geom's."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><material name="green" rgba="0 .8 0 1"/>'
        '<texture name="t" type="2d" builtin="checker" width="8" height="8"/><material name="checked" texture="t"/>'
        f'</asset><worldbody><geom type="sphere" size="0.5" {geom}/></worldbody></mujoco>'
    )
    assert target_color(model, 0, "jelly", given) == pytest.approx(shown)


def test_a_target_is_drawn_in_the_colour_of_its_geom(gl):
    body = '<geom name="t" type="sphere" size=".5" pos="0 0 .5" rgba="0 0.8 0 1"/>'
    shown = frame_of(gl, body, camera=FRONT, targets={"t": ball_surface("rubber")})[55:65, 75:85].mean(axis=(0, 1))
    assert shown[1] > shown[0] + 60
    assert shown[1] > shown[2] + 60


def test_unknown_look_names_the_valid_ones(gl):
    with pytest.raises(RippleError, match="'chrome'.*" + ".*".join(LOOKS)):
        frame_of(gl, '<geom name="t" type="sphere" size=".5"/>', targets={"t": ball_surface("chrome")})
