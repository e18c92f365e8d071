"""Cameras agree with MuJoCo's."""

import mujoco
import numpy as np
import pytest

from ripple_sim.render import Camera
from ripple_sim.render.camera import perspective, view_matrix
from ripple_sim.solver import RippleError

MJCF = """<mujoco><worldbody>
<geom size="1"/><camera name="side" pos="0 -5 1" xyaxes="1 0 0 0 .2 1"/>
</worldbody></mujoco>"""


def test_camera_follows_mujocos_convention():
    """At azimuth 90 and elevation 0 the camera looks along +y: +x is right, +z is up."""
    pose = Camera((0.5, 1.0, 2.0), 3.0, 90.0, 0.0).pose()
    np.testing.assert_allclose(pose.position, [0.5, -2.0, 2.0], atol=1e-12)
    np.testing.assert_allclose(pose.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(pose.focus, [0.5, 1.0, 2.0], atol=1e-12)
    clip = perspective(45.0, 2.0, 0.1, 100.0) @ view_matrix(pose)
    edge = np.tan(np.radians(22.5)) * 3.0
    point = clip @ [0.5 + 2 * edge, 1.0, 2.0 + edge, 1.0]
    np.testing.assert_allclose(point[:2] / point[3], [1.0, 1.0], atol=1e-12)


def test_camera_agrees_with_mujocos_own():
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    free = mujoco.MjvCamera()
    free.lookat[:], free.distance, free.azimuth, free.elevation = (0.3, -0.2, 0.1), 2.5, 37.0, -28.0
    scene = mujoco.MjvScene(model, maxgeom=50)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, free, mujoco.mjtCatBit.mjCAT_ALL, scene)
    eyes = [np.array(eye.pos, dtype=float) for eye in scene.camera]
    pose = Camera((0.3, -0.2, 0.1), 2.5, 37.0, -28.0).pose()
    np.testing.assert_allclose(pose.position, np.mean(eyes, axis=0), atol=1e-6)
    np.testing.assert_allclose(-pose.rotation[:, 2], scene.camera[0].forward, atol=1e-6)
    np.testing.assert_allclose(pose.rotation[:, 1], scene.camera[0].up, atol=1e-6)


def test_named_camera_and_the_error_for_an_unknown_one():
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pose = Camera.from_mjcf(model, data, "side").pose()
    np.testing.assert_allclose(pose.position, [0, -5, 1])
    assert -pose.rotation[1, 2] > 0.9
    with pytest.raises(RippleError, match=r"'sid'.*'side'"):
        Camera.from_mjcf(model, data, "sid")


@pytest.mark.parametrize("broken", [{"distance": 0.0}, {"fovy": 180.0}, {"azimuth": np.nan}])
def test_impossible_cameras_are_refused(broken):
    with pytest.raises(RippleError, match="camera"):
        Camera(**{"lookat": (0, 0, 0), "distance": 1.0, "azimuth": 0.0, "elevation": 0.0} | broken)
