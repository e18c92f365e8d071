"""What is not drawn is said."""

import mujoco
import pytest

from ripple_sim.errors import RippleWarning
from ripple_sim.render import Renderer


def test_what_is_not_drawn_is_said_once(gl):
    body = (
        """<body name="a" pos="0 0 1"><joint type="slide"/><geom size=".1"/><site name="s"/></body><site name="w"/>"""
    )
    tendon = '<tendon><spatial><site site="s"/><site site="w"/></spatial></tendon>'
    xml = f"<mujoco><worldbody>{body}</worldbody>{tendon}</mujoco>"
    with pytest.warns(RippleWarning, match="1 tendons"):
        Renderer(gl, mujoco.MjModel.from_xml_string(xml), {}, size=(32, 24)).close()
