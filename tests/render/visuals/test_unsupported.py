"""What is not drawn is said."""

import warnings

import mujoco
import pytest

from ripple_sim.errors import RippleWarning
from ripple_sim.render import Renderer
from ripple_sim.render.visuals.geoms import warn_of_unsupported


def test_what_is_not_drawn_is_said_once(gl):
    body = (
        """<body name="a" pos="0 0 1"><joint type="slide"/><geom size=".1"/><site name="s"/></body><site name="w"/>"""
    )
    tendon = '<tendon><spatial><site site="s"/><site site="w"/></spatial></tendon>'
    xml = f"<mujoco><worldbody>{body}</worldbody>{tendon}</mujoco>"
    with pytest.warns(RippleWarning, match="1 tendons"):
        Renderer(gl, mujoco.MjModel.from_xml_string(xml), {}, size=(32, 24)).close()


def test_a_fixed_tendon_has_nothing_to_draw():
    body = """<body><joint name="x" type="slide"/><geom size=".1"/></body>"""
    tendon = '<tendon><fixed><joint joint="x" coef="1"/></fixed></tendon>'
    with warnings.catch_warnings():
        warnings.simplefilter("error", RippleWarning)
        warn_of_unsupported(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody>{tendon}</mujoco>"))
