"""Height maps of several targets in one texture."""

import mujoco
import numpy as np
from sphere_height_maps import cube_charts

from ripple_sim.render import Camera, Renderer, Surface
from ripple_sim.render.visuals import shapes

SIZE = (203, 151)


def test_height_maps_of_different_resolutions_stay_apart(gl):
    """Targets that swell each by its own height cover what balls of these radii cover."""
    xml = """<mujoco><worldbody>
        <geom type="sphere" size=".5" pos="-.8 0 0"/><geom type="sphere" size=".5" pos=".8 0 0"/>
    </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ball = shapes.ball(16)
    resolutions, heights = (8, 20), (0.25, 0.1)

    def frame(radii: list[float], swell: tuple[float, float]) -> np.ndarray:
        surfaces = {
            geom: Surface(radii[geom] * ball.shell, ball.faces, cube_charts(ball.shell, resolutions[geom]), "clay")
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
