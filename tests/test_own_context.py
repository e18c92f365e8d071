"""A program's own current OpenGL context stays current beside ours."""

from collections.abc import Callable

import mujoco
import pytest
from own_context import own_context

from ripple_sim import Camera, Material, RippleRenderer, Ripples, diagnostics
from ripple_sim.render import Renderer
from ripple_sim.solver.gl import context, shared_context
from ripple_sim.solver.gl.current import EGLCurrent

MODEL = """<mujoco><worldbody><light pos="0 0 3"/><geom type="plane" size="2 2 1"/>
<geom name="target" type="box" size=".3 .3 .1" pos="0 0 .2"/></worldbody></mujoco>"""


@pytest.fixture
def keeps(opengl: None, monkeypatch: pytest.MonkeyPatch):
    """Call a function before any of our contexts exist; check the current context."""
    monkeypatch.setattr(context, "_shared", {})
    with own_context() as own:

        def called(function: Callable):
            result = function()
            assert EGLCurrent.of_thread() == own
            return result

        yield called


def test_ripples_that_make_the_first_context_leave_the_programs_context_current(keeps) -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    ripples = keeps(lambda: Ripples(model, {"target": Material(density=10.0)}, resolution=8))
    keeps(lambda: ripples.mj_step(data))
    with keeps(lambda: RippleRenderer(model, ripples, 12, 16)) as renderer:
        assert keeps(lambda: renderer.render(data)).any()
        renderer.enable_depth_rendering()
        assert keeps(lambda: renderer.render(data)).any()
        keeps(renderer.close)


def test_a_renderer_in_the_first_context_leaves_the_programs_context_current(keeps) -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = keeps(lambda: Renderer(shared_context(), model, {}, size=(16, 12)))
    keeps(lambda: renderer.submit(data, {}, Camera((0.0, 0.0, 0.2), 3.0, 90.0, -20.0)))
    assert keeps(renderer.fetch).any()
    keeps(renderer.close)


def test_a_report_that_makes_the_first_context_leaves_the_programs_context_current(keeps) -> None:
    assert keeps(diagnostics.collect)["opengl"]["renderer"]
