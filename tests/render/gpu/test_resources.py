"""What a renderer creates on the GPU is released with it."""

import gc

import mujoco
from drawn import BALL, FLOOR

from ripple_sim.render import Renderer


def test_renderers_leave_nothing_behind(gl):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{FLOOR}{BALL}</worldbody></mujoco>")

    def make() -> int:
        renderer = Renderer(gl, model, {}, size=(16, 12), samples=0)
        made = list(renderer._resources._created)
        del renderer
        gc.collect()
        with gl:
            return sum(type(each.mglo).__name__ != "InvalidObject" for each in made)

    assert [make() for _ in range(8)] == [0] * 8
