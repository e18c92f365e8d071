"""Gymnasium's environments ripple with each physics step, seen by their own camera."""

import functools
import importlib
import pickle
import sys
import types
import warnings
from pathlib import Path
from typing import Any, ClassVar

import mujoco
import numpy as np
import pytest
from mujoco_models import posed

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.envs.mujoco import MujocoEnv  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402

from ripple_sim import (  # noqa: E402
    Material,
    RippleError,
    RippleRenderer,
    Ripples,
    RippleWarning,
    add_sensor,
)
from ripple_sim.export.environment_renders import depth_buffer  # noqa: E402
from ripple_sim.gymnasium import (  # noqa: E402
    RippleWrapper,
    environment_camera,
    frame_size,
    model_and_data,
)
from ripple_sim.render import find_viewpoint  # noqa: E402

N = 16
MASS = 0.3
GRAVITY = 9.81
MODEL = f"""<mujoco><option timestep="0.002"/><worldbody><light pos="0 0 3"/>
<geom name="block" type="box" size="0.3 0.3 0.1" pos="0 0 -0.1" solref="0.01 0.3"/>
<body name="ball" pos="0.03 0.02 0.06"><freejoint/>
<geom size="0.05" mass="{MASS}" solref="0.01 0.3"/></body>
<body pos="0 0 2"><joint name="idle"/><geom name="idle" size="0.01"/></body></worldbody>
<actuator><motor joint="idle" ctrlrange="-1 1"/></actuator></mujoco>"""
MATERIALS = {"block": Material(speed=1.0, density=100.0)}
OPTIONS: dict[str, Any] = {"resolution": N, "backend": "cpu"}
STATIC = int(mujoco.mjtVisFlag.mjVIS_STATIC)
SPACE = gymnasium.spaces.Box(-np.inf, np.inf, (8,))


class BallEnv(MujocoEnv):
    """As Gymnasium's own: five physics steps at once."""

    metadata: ClassVar = {
        "render_modes": ["human", "rgb_array", "depth_array", "rgbd_tuple"],
        "render_fps": 100,
    }

    def __init__(self, path: Path, **options: Any) -> None:
        super().__init__(str(path), 5, SPACE, width=64, height=48, **options)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        self.do_simulation(action, self.frame_skip)
        return self.data.qpos.copy(), 0.0, False, False, {"height": self.data.qpos[2]}

    def reset_model(self) -> np.ndarray:
        return self.data.qpos.copy()


class NewModelEnv(gymnasium.Env):
    """Another's: no `MujocoEnv`, a loop of its own, and a new model for each episode."""

    observation_space = SPACE
    action_space = gymnasium.spaces.Box(-1, 1, (1,))

    def __init__(self) -> None:
        self.reset()

    def reset(self, **_: Any) -> tuple[np.ndarray, dict[str, Any]]:
        self.model = mujoco.MjModel.from_xml_string(MODEL)
        self.data = mujoco.MjData(self.model)
        return self.data.qpos.copy(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        self.data.ctrl[:] = action
        for _ in range(3):
            mujoco.mj_step1(self.model, self.data)
            mujoco.mj_step2(self.model, self.data)
        mujoco.mj_step(self.model, self.data, nstep=2)
        return self.data.qpos.copy(), 0.0, False, False, {}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "ball.xml"
    file.write_text(MODEL)
    return file


@pytest.mark.parametrize("kind", [BallEnv, NewModelEnv])
def test_waves_advance_at_each_physics_step(kind: type, path: Path) -> None:
    env = RippleWrapper(kind(path) if kind is BallEnv else kind(), MATERIALS, **OPTIONS)
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    ripples = Ripples(model, MATERIALS, **OPTIONS)
    for _ in range(2):
        env.reset()
        mujoco.mj_resetData(model, data)
        given = 0.0
        with warnings.catch_warnings(action="error", category=RippleWarning):
            for _ in range(40):
                *_, info = env.step(np.zeros(1))
                given += sum(impulse.impulse for impulse in info["impulses"])
                ripples.mj_step(data, nstep=5)
        assert given == pytest.approx(MASS * (data.qvel[2] + GRAVITY * data.time), rel=5e-3)
        assert np.abs(info["heights"]["block"]).max() > 1e-4
        np.testing.assert_array_equal(info["heights"]["block"], ripples["block"].height)


def test_info_of_the_environment_stays_and_a_reset_flattens(path: Path) -> None:
    env = RippleWrapper(BallEnv(path), MATERIALS, **OPTIONS)
    env.reset(seed=3)
    for _ in range(20):
        *_, info = env.step(np.zeros(1))
    assert info["height"] == env.unwrapped.data.qpos[2]
    assert info["heights"]["block"].any()
    _, info = env.reset(seed=3)
    assert info["impulses"] == [] and not info["heights"]["block"].any()
    assert env.ripples["block"].time == 0.0


@pytest.mark.parametrize("mode", ["rgb_array", "depth_array", "rgbd_tuple"])
def test_frames_show_the_ripples_in_the_size_of_the_environment(path: Path, mode: str) -> None:
    near = {"distance": 0.7, "lookat": np.zeros(3)}
    ball = BallEnv(
        path, render_mode=mode, default_camera_config=near, visual_options={STATIC: True}
    )
    env = RippleWrapper(ball, MATERIALS, looks={"block": "jelly"}, **OPTIONS)

    def frames() -> list[np.ndarray]:
        drawn = env.render()
        return list(drawn) if isinstance(drawn, tuple) else [drawn]

    env.reset()
    env.step(np.zeros(1))
    flat = frames()
    env.ripples["block"].velocity = np.random.default_rng(2).standard_normal((6, N, N)) / 10
    env.ripples["block"].step(0.02)
    rippled = frames()
    for before, after in zip(flat, rippled, strict=True):
        if before.dtype == np.uint8:
            assert before.shape == after.shape == (48, 64, 3)
            assert np.abs(after.astype(int) - before).mean() > 1
        else:
            assert before.shape == after.shape == (48, 64) and before.dtype == np.float32
            assert 1e-5 < np.abs(after - before).max() < 0.1
    assert len(flat) == 1 + (mode == "rgbd_tuple")
    env.close()


GOAL = [0.2, 0.0, 0.3]
MARKER = [-0.2, 0.0, 0.2]


class MarkedEnv(BallEnv):
    """Like environments of Gymnasium-Robotics: its `render` moves a body and adds a marker."""

    def render(self) -> Any:
        self.data.geom("idle").xpos[:] = GOAL
        if self.mujoco_renderer.viewer is not None:
            self.mujoco_renderer.viewer.add_marker(pos=MARKER, size=[0.05] * 3)
        return super().render()


class HoldingEnv(gymnasium.Env):
    """As mazes and kitchens: the environment with the camera is inside."""

    observation_space = SPACE
    action_space = gymnasium.spaces.Box(-1, 1, (1,))
    metadata = BallEnv.metadata
    model = property(lambda e: e.inner.model)
    data = property(lambda e: e.inner.data)

    def __init__(self, path: Path, render_mode: str, **options: Any) -> None:
        self.inner = BallEnv(path, render_mode=render_mode, **options)
        self.render_mode = render_mode

    def reset(self, **_: Any) -> Any:
        return self.inner.reset()

    def render(self) -> Any:
        return self.inner.render()


class RendererEnv(HoldingEnv):
    """With MuJoCo's own renderer, and a geom of its own in the scene."""

    def __init__(self, path: Path, render_mode: str, **options: Any) -> None:
        super().__init__(path, render_mode, **options)
        # without MuJoCo's OpenGL context, which the tests' driver may lack
        self.renderer = mujoco.Renderer.__new__(mujoco.Renderer)
        fields = {"model": self.model, "width": 64, "height": 48, "segmentation_rendering": False}
        fields |= {"depth_rendering": True, "gl_context": None, "mjr_context": None}
        for name, value in fields.items():
            setattr(self.renderer, f"_{name}", value)

    def render(self) -> Any:
        self.data.geom("idle").xpos[:] = GOAL
        self.renderer.update_scene(self.data, camera_with(CAMERA))
        add_ball(self.renderer.scene)
        return depth_buffer(self.model, self.renderer.render())


CAMERA = {"distance": 0.9, "azimuth": 90.0, "elevation": -20.0, "lookat": np.array([0.0, 0.0, 0.1])}


def camera_with(config: dict[str, Any]) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    for name, value in config.items():
        setattr(camera, name, value)
    return camera


def add_ball(scene: mujoco.MjvScene) -> None:
    ball = mujoco.mjtGeom.mjGEOM_SPHERE
    turned = np.eye(3).ravel()
    white = np.ones(4, np.float32)
    mujoco.mjv_initGeom(
        scene.geoms[scene.ngeom], ball, np.full(3, 0.05), np.array(MARKER), turned, white
    )
    scene.ngeom += 1


@pytest.mark.parametrize("kind", [BallEnv, MarkedEnv, HoldingEnv, RendererEnv])
def test_an_environments_own_render_and_camera_are_used(kind: type, path: Path) -> None:
    env = RippleWrapper(kind(path, render_mode="depth_array", default_camera_config=CAMERA), {})
    env.reset()
    mujoco.mj_forward(env.unwrapped.model, env.unwrapped.data)
    with warnings.catch_warnings(action="error", category=RippleWarning):
        frame = [env.render() for _ in range(2)][-1]
    model = env.unwrapped.model
    data = mujoco.MjData(env.unwrapped.model)
    mujoco.mj_forward(model, data)
    marked = kind in (MarkedEnv, RendererEnv)
    if marked:
        data.geom("idle").xpos[:] = GOAL
    with RippleRenderer(model, Ripples(model, {}), 48, 64) as renderer:
        renderer.update_scene(data, camera_with(CAMERA))
        if marked:
            add_ball(renderer.scene)
        renderer.enable_depth_rendering()
        expected = depth_buffer(model, renderer.render())
    np.testing.assert_array_equal(frame, expected)
    assert np.ptp(frame) > 0.01
    env.close()


def test_renderers_of_other_environments_stay_as_they_were(path: Path) -> None:
    from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer

    before = MujocoRenderer._get_viewer, mujoco.Renderer.render, mujoco.Renderer.scene
    env = RippleWrapper(BallEnv(path, render_mode="rgb_array"), MATERIALS, **OPTIONS)
    env.reset()
    env.render()
    assert (MujocoRenderer._get_viewer, mujoco.Renderer.render, mujoco.Renderer.scene) == before
    assert not env.unwrapped.mujoco_renderer._viewers
    env.close()


class PaintingEnv(HoldingEnv):
    def render(self) -> Any:
        return np.zeros((48, 64, 3), np.uint8)


def test_warning_about_a_render_that_draws_by_itself(path: Path) -> None:
    env = RippleWrapper(PaintingEnv(path, "rgb_array"), MATERIALS, **OPTIONS)
    env.reset()
    with pytest.warns(
        RippleWarning,
        match="neither Gymnasium's MujocoRenderer nor mujoco.Renderer has drawn; the mod",
    ):
        assert np.ptp(env.render()) > 0
    with warnings.catch_warnings(action="error", category=RippleWarning):
        env.render()
    env.close()


def test_depths_are_those_of_a_depth_buffer() -> None:
    """As OpenGL has them: 0 at the near plane, 1 at the far one, and hyperbolic between."""
    model = mujoco.MjModel.from_xml_string(VIEWED)
    near, far = model.stat.extent * np.array([model.vis.map.znear, model.vis.map.zfar])
    depth = np.array([near, 2 * near, far], np.float32)
    np.testing.assert_allclose(
        depth_buffer(model, depth), [0.0, 0.5 / (1 - near / far), 1.0], atol=1e-6
    )


def test_warning_about_render_modes_without_ripples(path: Path) -> None:
    with pytest.warns(RippleWarning, match="'human', which shows no ripples"):
        RippleWrapper(BallEnv(path, render_mode="human"), MATERIALS, **OPTIONS)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("mode", "count", "keywords"), [("sync", 2, {}), ("async", 1, {"context": "spawn"})]
)
def test_make_vec_makes_ripples_in_this_process_and_in_another(
    mode: str, count: int, keywords: dict[str, Any]
) -> None:
    materials = {"torso_geom": Material(density=100.0)}
    feel = {"geom": "torso_geom", "at": [0, 0, 1.0], "rate": 1000}
    wrapper = functools.partial(
        RippleWrapper, materials=materials, sensors={"feel": feel}, **OPTIONS
    )
    how = {"num_envs": count, "vectorization_mode": mode, "vector_kwargs": keywords}
    envs = gymnasium.make_vec("Ant-v5", **how, wrappers=[wrapper], max_episode_steps=3)
    _, info = envs.reset(seed=1)
    assert info["heights"]["torso_geom"].shape == (count, 6, N, N)
    for _ in range(3):
        observation, *_, truncated, info = envs.step(np.zeros(envs.action_space.shape))
    assert observation["feel"].shape == (count, 50, 1) and observation["feel"].dtype == np.float32
    assert truncated.all()
    *_, info = envs.step(np.zeros(envs.action_space.shape))
    assert not info["heights"]["torso_geom"].any(), "flat in the new episode"
    envs.close()


def test_gymnasiums_wrappers_work_around_a_ripple_wrapper(path: Path) -> None:
    env = RippleWrapper(BallEnv(path, render_mode="rgb_array"), MATERIALS, **OPTIONS)
    env = gymnasium.wrappers.TimeLimit(gymnasium.wrappers.PassiveEnvChecker(env), 2)
    env = gymnasium.wrappers.RenderCollection(env)
    env.reset(seed=0)
    truncated = [env.step(np.zeros(1, np.float32))[3] for _ in range(2)]
    assert truncated == [False, True]
    assert np.shape(env.render()) == (3, 48, 64, 3)
    env.close()


def test_record_video_gets_every_frame_with_its_ripples(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A stand-in for moviepy, which writes the files and is no dependency."""
    written: dict[str, tuple[list[np.ndarray], int]] = {}

    class Clip:
        def __init__(self, frames: list[np.ndarray], fps: int) -> None:
            self.made = list(frames), fps

        def write_videofile(self, file: str, logger: object) -> None:
            written[Path(file).name] = self.made

    for name in (
        "moviepy",
        "moviepy.video",
        "moviepy.video.io",
        "moviepy.video.io.ImageSequenceClip",
    ):
        module = types.ModuleType(name)
        module.ImageSequenceClip = Clip  # type: ignore[attr-defined]
        monkeypatch.setitem(sys.modules, name, module)
    rippling = RippleWrapper(BallEnv(path, render_mode="rgb_array"), MATERIALS, **OPTIONS)
    env = gymnasium.wrappers.RecordVideo(
        rippling, str(path.parent), episode_trigger=lambda episode: episode < 2
    )
    for _ in range(3):
        env.reset(seed=0)
        for _ in range(3):
            env.step(np.zeros(1, np.float32))
        last = rippling.render()
    env.close()
    assert list(written) == ["rl-video-episode-0.mp4", "rl-video-episode-1.mp4"]
    for frames, fps in written.values():
        assert (np.shape(frames), fps) == ((4, 48, 64, 3), 100)
        np.testing.assert_array_equal(frames[-1], last)
        assert (frames[0] != last).any()


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_gymnasium_checks_pass_on_its_ant_remade_by_spec_or_pickle() -> None:
    env = RippleWrapper(
        gymnasium.make("Ant-v5"), {"torso_geom": Material(density=100.0)}, **OPTIONS
    )
    check_env(env, skip_render_check=True)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    for again in (gymnasium.make(env.spec), pickle.loads(pickle.dumps(env))):
        assert isinstance(again, RippleWrapper) and list(again.ripples) == ["torso_geom"]
        assert again.ripples["torso_geom"].atlas.areas.shape[-1] == N
        assert again.ripples["torso_geom"].time == 0.0 < env.ripples["torso_geom"].time


def test_gymnasium_finds_no_fault_where_a_target_is_touched_at_the_first_step(path: Path) -> None:
    """It compares what two equal runs have in `info`."""
    path.write_text(MODEL.replace("0.02 0.06", "0.02 0.049"))
    ball = BallEnv(path)
    ball.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (8,), np.float64)
    env = RippleWrapper(ball, MATERIALS, **OPTIONS)
    env.reset(seed=0)
    assert env.step(env.action_space.sample())[-1]["impulses"]
    check_env(env, skip_render_check=True)


def test_environments_without_a_model_are_refused() -> None:
    with pytest.raises(
        RippleError, match=r"CartPole.* has no `model` and `data`: it must be a MuJoCo environment"
    ):
        RippleWrapper(gymnasium.make("CartPole-v1"), MATERIALS)


def test_without_gymnasium_the_message_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("ripple_sim.gymnasium")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(ImportError, match=r"pip install 'ripple-sim\[gymnasium\]'"):
        importlib.import_module("ripple_sim.gymnasium")


VIEWED = """<mujoco><visual><global fovy="38"/></visual><worldbody><geom type="plane" size="2 2 1"/>
<body pos="0.3 -0.2 1"><freejoint/><geom size="0.1"/><geom size="0.1" pos="0.2 0 0"/>
<camera name="track" mode="trackcom" pos="0 -3 0.3" xyaxes="1 0 0 0 0 1" fovy="50"/></body>
</worldbody></mujoco>"""
TRACKING = {
    "trackbodyid": 1,
    "lookat": np.array([0.0, 0.1, 2.0]),
    "elevation": -20.0,
    "azimuth": 30.0,
}


def pose_of_mujoco(model: mujoco.MjModel, data: mujoco.MjData, camera_id: int, config: dict):
    """Pose and view of Gymnasium's camera: free, aimed at the median, with settings."""
    camera = mujoco.MjvCamera()
    scene = mujoco.MjvScene(model, 100)
    camera.type = (
        mujoco.mjtCamera.mjCAMERA_FREE if camera_id < 0 else mujoco.mjtCamera.mjCAMERA_FIXED
    )
    camera.fixedcamid = camera_id
    camera.lookat = np.median(data.geom_xpos, axis=0)
    camera.distance = model.stat.extent
    for name, value in config.items():
        setattr(camera, name, value)
    option = mujoco.MjvOption()
    perturb = mujoco.MjvPerturb()
    everything = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, option, perturb, camera, everything, scene)
    eyes = scene.camera[:2]
    return np.mean([eye.pos for eye in eyes], axis=0), np.array([eyes[0].forward, eyes[0].up])


@pytest.mark.parametrize("camera_id", [-1, 0])
@pytest.mark.parametrize("config", [{}, {"distance": 4.0}, TRACKING])
def test_the_camera_has_the_pose_of_gymnasiums(camera_id: int, config: dict[str, object]) -> None:
    model, data = posed(VIEWED)
    viewer = types.SimpleNamespace(
        camera_id=camera_id, default_cam_config=config or None, width=320, height=200
    )
    env = types.SimpleNamespace(model=model, data=data, mujoco_renderer=viewer)
    camera = environment_camera(env, model, np.median(data.geom_xpos, axis=0))
    pose = find_viewpoint(model, data, camera).pose()
    position, (forward, up) = pose_of_mujoco(model, data, camera_id, config)
    np.testing.assert_allclose(pose.position, position, atol=1e-5)
    np.testing.assert_allclose(-pose.rotation[:, 2], forward, atol=1e-5)
    np.testing.assert_allclose(pose.rotation[:, 1], up, atol=1e-5)
    # of numbers that MuJoCo holds as float32
    assert pose.fovy == pytest.approx(38 if camera_id < 0 else 50, rel=1e-6)
    assert frame_size(env) == (320, 200)


def test_environments_without_a_size_or_camera_get_defaults() -> None:
    model, data = posed(VIEWED)
    wrapped = types.SimpleNamespace(
        model=types.SimpleNamespace(ptr=model), data=types.SimpleNamespace(ptr=data)
    )
    env = types.SimpleNamespace(physics=wrapped)
    assert model_and_data(env) == (model, data)
    assert frame_size(env) == (480, 480)
    camera = environment_camera(env, model, np.median(data.geom_xpos, axis=0))
    assert (camera.type, camera.distance) == (mujoco.mjtCamera.mjCAMERA_FREE, model.stat.extent)


def test_sensors_add_their_samples_to_the_observations(path: Path) -> None:
    sensors = {
        "tap": {"geom": "block", "at": [[0.2, 0, 0.1], [-0.2, 0, 0.1]], "rate": 500},
        "sag": {"geom": "block", "at": [0, 0, 0.1], "kind": "height", "rate": 1000},
    }
    materials = {"block": Material(speed=20.0, density=100.0)}
    env = RippleWrapper(BallEnv(path), materials, sensors=sensors, **OPTIONS)
    observation, _ = env.reset(seed=0)
    assert not observation["tap"].any()
    steps = [env.step(np.zeros(1))[0] for _ in range(30)]
    spaces = env.observation_space.spaces
    assert all(each[name] in spaces[name] for each in steps for name in sensors)
    assert steps[0]["tap"].shape == (5, 2) and steps[0]["sag"].shape == (10, 1)
    blocks = np.concatenate([each["sag"] for each in steps])
    other = RippleWrapper(BallEnv(path), materials, **OPTIONS)
    other.reset(seed=0)
    alone = other.ripples["block"].sensor([0, 0, 0.1], "height", 1000)
    for _ in range(30):
        other.step(np.zeros(1))
    late = len(blocks) - int(np.argmax(np.abs(blocks) > 0))
    np.testing.assert_array_equal(
        blocks[-late:], alone.samples[np.argmax(np.abs(alone.samples) > 0) :][:late]
    )
    again, _ = env.reset(seed=0)
    assert not again["sag"].any()
    with pytest.raises(
        RippleError,
        match=r"in a control step of 0\.01 s must be a whole number, got 5\.01; choose the rate",
    ):
        RippleWrapper(
            BallEnv(path), materials, sensors={"tap": sensors["tap"] | {"rate": 501}}, **OPTIONS
        )


def test_observations_have_the_samples_of_the_models_own_sensors(tmp_path: Path) -> None:
    spec = mujoco.MjSpec.from_string(MODEL)
    spec.worldbody.add_site(name="top", pos=[0.2, 0.0, 0.0])
    add_sensor(spec, "tap", geom="block", site="top", rate=1000)
    path = tmp_path / "sensor.xml"
    path.write_text(spec.to_xml())
    materials = {"block": Material(speed=20.0, density=100.0)}
    env = RippleWrapper(BallEnv(path), materials, sensors=["tap"], **OPTIONS)
    first, _ = env.reset(seed=0)
    observations = [env.step(np.zeros(1))[0] for _ in range(30)]
    taps = np.array([observation["tap"] for observation in observations])
    assert env.observation_space["tap"].shape == (10, 1) == taps[0].shape
    assert not first["tap"].any() and taps.any()
    # two samples in each of the five physics steps of a control step
    data = env.unwrapped.data
    np.testing.assert_array_equal(data.sensor("tap").data, taps[-1, -2:, 0])
    env.reset(seed=0)
    assert not data.sensordata.any()
    again = [env.step(np.zeros(1))[0]["tap"] for _ in range(30)]
    np.testing.assert_array_equal(again, taps)
    with pytest.raises(RippleError, match="got 'rap'; the model's sensors are 'tap'"):
        RippleWrapper(BallEnv(path), materials, sensors=["rap"], **OPTIONS)
    with pytest.raises(RippleError, match="must be none of 'observation', got 'observation'"):
        taken = {"observation": {"geom": "block", "at": "top", "rate": 1000}}
        RippleWrapper(BallEnv(path), materials, sensors=taken, **OPTIONS)
