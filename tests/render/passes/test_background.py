"""The coarse background against every pixel shaded."""

import mujoco
import numpy as np
import pytest

from ripple_sim.render import Camera, Renderer
from ripple_sim.render.passes import deferred
from ripple_sim.solver.gl import GLContext

SUN = '<light directional="true" dir="-.3 .4 -1"/>'
SPOT = '<light pos="1 -1 2" dir="-.5 .5 -1" cutoff="25" castshadow="true"/>'
SOLIDS = '<geom type="sphere" size=".2" pos="0 0 .2"/><geom type="capsule" size=".05 .3" pos=".6 .2 .5"/>'


def frame_of(
    gl: GLContext, light: str, floor: str, camera: Camera, solids: str = SOLIDS, size: tuple[int, int] = (203, 151)
) -> np.ndarray:
    """A frame, whose size is no multiple of a block."""
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody>{light}<geom type="plane" size="{floor}" rgba=".8 .7 .6 1"/>{solids}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with Renderer(gl, model, {}, size=size) as renderer:
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


@pytest.mark.parametrize(
    "solid",
    [
        '<geom type="ellipsoid" size=".1 .3 .1" pos=".2 0 .4"/><geom type="box" size=".03 .2 .4" pos="-.3 0 .4"/>',
        '<geom type="box" size=".2 .2 .2" pos="0 0 .2" euler="0 0 20" rgba=".8 .2 .2 .6"/>',
    ],
    ids=["wide", "transparent"],
)
def test_interpolated_penumbras_end_where_those_of_each_pixel_do(gl, monkeypatch, solid):
    arguments = "", "0 0 .1", Camera((0, 0, 0.2), 1.3, 110.0, -22.0), solid, (803, 451)
    interpolated = frame_of(gl, *arguments)
    monkeypatch.setattr(deferred, "CoarseBackground", deferred.Background)
    exact = frame_of(gl, *arguments)
    assert np.abs(interpolated - exact).max() <= 8
