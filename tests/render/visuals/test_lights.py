"""Lights of the MJCF, in linear light."""

import mujoco
import numpy as np
from drawn import ABOVE, SUN

from ripple_sim.render.visuals.lights import model_lighting


def test_light_adds_up_to_mujocos_brightness_in_both_extremes():
    xml = f"""<mujoco><visual><headlight ambient=".2 .2 .2" diffuse=".3 .3 .3"/></visual>
    <worldbody>{SUN.format(0.0, "true").replace(".8 .8 .8", ".4 .4 .4")}</worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lighting = model_lighting(model, data, ABOVE.pose())
    total = lighting.ambient + lighting.on(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    # MuJoCo's sums, from sRGB to linear light
    np.testing.assert_allclose(lighting.ambient, ((0.2 + 0.055) / 1.055) ** 2.4, rtol=1e-6)
    np.testing.assert_allclose(total, ((0.9 + 0.055) / 1.055) ** 2.4, rtol=1e-3)
    assert lighting.lights[0].shadow


def test_the_beam_of_a_spot_falls_off_in_srgb_as_in_mujoco():
    """At 60 degrees from the axis, MuJoCo's cosine to the power of 2 leaves a quarter of the light, in sRGB."""
    lamp = '<light pos="0 0 1" dir="0 0 -1" diffuse=".5 .5 .5" cutoff="80" exponent="2"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><visual><headlight active="0"/></visual><worldbody>{lamp}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lighting = model_lighting(model, data, ABOVE.pose())
    beside = np.array([np.sqrt(3.0), 0.0, 0.0])
    towards = np.array([-np.sqrt(3.0), 0.0, 1.0]) / 2
    under, aside = lighting.on(np.zeros(3), np.array([0.0, 0.0, 1.0])), lighting.on(beside, towards)
    np.testing.assert_allclose((aside / under) ** (1 / 2.2), 0.25, rtol=1e-6)
