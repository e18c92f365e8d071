"""The coarse background against every pixel shaded."""

import mujoco
import numpy as np
import pytest

from ripple_sim.render import Camera, Renderer
from ripple_sim.render.passes import deferred
from ripple_sim.solver.gl import GLContext

SUN = '<light directional="true" dir="-.3 .4 -1"/>'


SPOT = '<light pos="1 -1 2" dir="-.5 .5 -1" cutoff="25" castshadow="true"/>'


SIZE = (203, 151)  # no multiple of a block


def frame_of(gl: GLContext, light: str, floor: str, camera: Camera) -> np.ndarray:
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><worldbody>{light}
        <geom type="plane" size="{floor}" rgba=".8 .7 .6 1"/>
        <geom type="sphere" size=".2" pos="0 0 .2"/>
        <geom type="capsule" size=".05 .3" pos=".6 .2 .5"/>
    </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with Renderer(gl, model, {}, size=SIZE) as renderer:
        return renderer.render(data, {}, camera).astype(int)


@pytest.mark.parametrize("light", [SUN, SPOT, ""], ids=["sun", "spot", "studio"])
@pytest.mark.parametrize("floor", ["0 0 .1", "1.2 .9 .1"], ids=["endless", "finite"])
@pytest.mark.parametrize("elevation", [-3.0, -25.0])
def test_the_interpolated_background_is_that_of_each_pixel(gl, monkeypatch, light, floor, elevation):
    camera = Camera((0, 0, 0.2), 3.0, 70.0, elevation)
    interpolated = frame_of(gl, light, floor, camera)
    monkeypatch.setattr(deferred, "CoarseBackground", deferred.Background)
    exact = frame_of(gl, light, floor, camera)
    assert exact.std() > 5
    assert np.abs(interpolated - exact).max() <= 3
