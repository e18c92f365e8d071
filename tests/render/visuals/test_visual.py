"""Visuals: the geoms and sites that MuJoCo shows.

Looks of MuJoCo's materials.
"""

import numpy as np
import pytest
from drawn import BALL, FLOOR, FRONT, SIZE, frame_of
from textured import textured_model

from ripple_sim.render.visuals.visual import geom_visual, look_of


def test_groups_above_two_are_hidden(gl):
    hidden = BALL.replace("/>", ' group="3"/>')
    np.testing.assert_array_equal(frame_of(gl, FLOOR + hidden), frame_of(gl, FLOOR))
    assert np.abs(frame_of(gl, FLOOR + BALL) - frame_of(gl, FLOOR)).max() > 60


def test_sites_of_visible_groups_are_drawn_like_geoms(gl):
    """As MuJoCo draws them: round, in their colour or their material's, clear where they are, with a shadow."""
    site = '<site type="sphere" size=".3" pos="0 0 .8" {}/>'
    plain = frame_of(gl, FLOOR, camera=FRONT)
    as_body = frame_of(gl, FLOOR + BALL, camera=FRONT)
    as_site = frame_of(gl, FLOOR + site.format('rgba=".8 .2 .2 1"'), camera=FRONT)
    ball = (as_body[..., 0] - as_body[..., 2] > 60) & (as_site[..., 0] - as_site[..., 2] > 60)
    assert ball.sum() > 400
    upper = ball & (np.arange(SIZE[1])[:, None] < 45)  # of the floor's light the body shades itself a little
    np.testing.assert_allclose(as_site[upper], as_body[upper], atol=16)
    np.testing.assert_array_equal(frame_of(gl, FLOOR + site.format('group="3"'), camera=FRONT), plain)
    clear = frame_of(gl, FLOOR + site.format('rgba=".8 .2 .2 .3"'), camera=FRONT)
    assert (as_site[ball][:, 0] - as_site[ball][:, 2]).mean() > 2 * (clear[ball][:, 0] - clear[ball][:, 2]).mean() > 10
    green = frame_of(gl, site.format('material="g"'), asset='<material name="g" rgba="0 .8 0 1"/>', camera=FRONT)
    assert (green[ball][:, 1] > green[ball][:, 0] + 60).mean() > 0.9


def test_a_material_answers_light_as_it_says():
    """Roughness is taken where it is given; otherwise more shininess is less of it. Reflectance is a coat."""

    def look(attributes: str):
        return look_of(model := textured_model('<geom size=".1" material="m"/>', attributes), geom_visual(model, 0))

    assert look('roughness="0.3" metallic="1" shininess="0.9"').roughness == pytest.approx(0.3)
    assert look('roughness="0.3" metallic="1"').metallic == 1.0
    assert look('shininess="0"').roughness > look('shininess="0.5"').roughness > look('shininess="1"').roughness
    assert look('reflectance="0.4"').coat == pytest.approx(0.4)
    assert look('emission="0.7"').emission == pytest.approx(0.7)
    assert look("").metallic == 0.0
