"""What the renderer does by shortcuts against the long way round. Needs an OpenGL context; software will do."""

import mujoco
import numpy as np
import pytest

from ripple_sim.render import Camera, Renderer, Surface
from ripple_sim.render.passes import deferred
from ripple_sim.render.visuals import primitives as meshes
from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import GLContext, shared_context

SUN = '<light directional="true" dir="-.3 .4 -1"/>'
SPOT = '<light pos="1 -1 2" dir="-.5 .5 -1" cutoff="25" castshadow="true"/>'
SIZE = (203, 151)  # no multiple of a block


@pytest.fixture(scope="module")
def gl() -> GLContext:
    try:
        return shared_context()
    except GLError as error:
        pytest.skip(f"no OpenGL context: {error}")


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
    monkeypatch.setattr(deferred, "CoarseBackground", lambda *_: None)
    exact = frame_of(gl, light, floor, camera)
    assert exact.std() > 5
    assert np.abs(interpolated - exact).max() <= 3


def test_height_maps_of_different_resolutions_stay_apart(gl):
    """Targets that swell each by its own height cover what balls of these radii cover."""
    xml = """<mujoco><worldbody>
        <geom type="sphere" size=".5" pos="-.8 0 0"/><geom type="sphere" size=".5" pos=".8 0 0"/>
    </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ball = meshes.ball(16)
    resolutions, heights = (8, 20), (0.25, 0.1)

    def frame(radii: list[float], swell: tuple[float, float]) -> np.ndarray:
        surfaces = {
            geom: Surface(radii[geom] * ball.shell, ball.faces, ball.shell, resolutions[geom], "clay")
            for geom in range(2)
        }
        height_maps = {
            geom: np.full((6, n + 2, n + 2, 4), [0, 0, 0, swell[geom]], dtype=np.float32)
            for geom, n in enumerate(resolutions)
        }
        with Renderer(gl, model, surfaces, size=SIZE) as renderer:
            return renderer.render(data, height_maps, Camera((0, 0, 0), 4.0, 90.0, 0.0)).astype(int)

    swollen, larger = frame([0.5, 0.5], heights), frame([0.5 + h for h in heights], (0.0, 0.0))
    assert (np.abs(swollen - larger).max(axis=2) > 24).mean() < 2e-3
    assert (np.abs(swollen - frame([0.5, 0.5], (0.0, 0.0))).max(axis=2) > 24).mean() > 0.02
