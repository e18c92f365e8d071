"""What a renderer creates on the GPU is released with it, but for programs: the next one takes them."""

import gc

import moderngl
import mujoco
from drawn import BALL, FLOOR

from ripple_sim.render import Renderer


def test_renderers_leave_nothing_behind(gl):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{FLOOR}{BALL}</worldbody></mujoco>")

    def make() -> tuple[int, set[int]]:
        renderer = Renderer(gl, model, {}, size=(16, 12), samples=0)
        made = list(renderer._resources._created)
        del renderer
        gc.collect()
        with gl:
            left = [each for each in made if type(each.mglo).__name__ != "InvalidObject"]
            programs = {each.glo for each in left if isinstance(each, moderngl.Program | moderngl.ComputeShader)}
            return len(left) - len(programs), programs

    gc.collect()  # the programs of earlier tests' renderers must not come in between
    others, programs = zip(*(make() for _ in range(8)), strict=True)
    assert others == (0,) * 8
    assert programs == programs[:1] * 8
