"""The environment's camera, held against the one that MuJoCo's own visualiser would set up."""

import types

import mujoco
import numpy as np
import pytest

pytest.importorskip("gymnasium")
from ripple_sim.gymnasium import EnvironmentCamera, frame_size, model_and_data

MODEL = """<mujoco><visual><global fovy="38"/></visual><worldbody><geom type="plane" size="2 2 1"/>
<body pos="0.3 -0.2 1"><freejoint/><geom size="0.1"/><geom size="0.1" pos="0.2 0 0"/>
<camera name="track" mode="trackcom" pos="0 -3 0.3" xyaxes="1 0 0 0 0 1" fovy="50"/></body></worldbody></mujoco>"""


def pose_of_mujoco(
    model: mujoco.MjModel, data: mujoco.MjData, camera_id: int, config: dict[str, object]
) -> tuple[np.ndarray, np.ndarray]:
    """Position and view of Gymnasium's camera: free by default, aimed at the median, with the settings on top."""
    camera, scene = mujoco.MjvCamera(), mujoco.MjvScene(model, 100)
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE if camera_id < 0 else mujoco.mjtCamera.mjCAMERA_FIXED
    camera.fixedcamid = camera_id
    camera.lookat, camera.distance = np.median(data.geom_xpos, axis=0), model.stat.extent
    for name, value in config.items():
        setattr(camera, name, value)
    option, perturb, everything = mujoco.MjvOption(), mujoco.MjvPerturb(), mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, option, perturb, camera, everything, scene)
    eyes = scene.camera[:2]
    return np.mean([eye.pos for eye in eyes], axis=0), np.array([eyes[0].forward, eyes[0].up])


@pytest.mark.parametrize("camera_id", [-1, 0])
@pytest.mark.parametrize(
    "config",
    [
        {},
        {"distance": 4.0},
        {"trackbodyid": 1, "lookat": np.array([0.0, 0.1, 2.0]), "elevation": -20.0, "azimuth": 30.0},
    ],
)
def test_the_camera_is_gymnasiums(camera_id: int, config: dict[str, object]) -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    viewer = types.SimpleNamespace(camera_id=camera_id, default_cam_config=config or None, width=320, height=200)
    env = types.SimpleNamespace(model=model, data=data, mujoco_renderer=viewer)
    pose = EnvironmentCamera(env)(model, data).pose()
    position, (forward, up) = pose_of_mujoco(model, data, camera_id, config)
    np.testing.assert_allclose(pose.position, position, atol=1e-5)
    np.testing.assert_allclose(-pose.rotation[:, 2], forward, atol=1e-5)
    np.testing.assert_allclose(pose.rotation[:, 1], up, atol=1e-5)
    assert pose.fovy == (38 if camera_id < 0 else 50)
    assert frame_size(env) == (320, 200)


def test_environments_that_do_not_say_have_defaults() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    wrapped = types.SimpleNamespace(model=types.SimpleNamespace(ptr=model), data=types.SimpleNamespace(ptr=data))
    env = types.SimpleNamespace(physics=wrapped)
    assert model_and_data(env) == (model, data)
    assert frame_size(env) == (480, 480)
    assert EnvironmentCamera(env)(model, data).pose().fovy == 38
