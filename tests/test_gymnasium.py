"""Environments of Gymnasium ripple with each of their physics steps, and stay environments of Gymnasium."""

import importlib
import pickle
import sys
import warnings
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.envs.mujoco import MujocoEnv  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402

from ripple_sim import Material, RippleError, Ripples, RippleWarning  # noqa: E402
from ripple_sim.gymnasium import RippleWrapper  # noqa: E402

N = 16
MASS, GRAVITY = 0.3, 9.81
MODEL = f"""<mujoco><option timestep="0.002"/><worldbody><light pos="0 0 3"/>
<geom name="block" type="box" size="0.3 0.3 0.1" pos="0 0 -0.1" solref="0.01 0.3"/>
<body name="ball" pos="0.03 0.02 0.06"><freejoint/><geom size="0.05" mass="{MASS}" solref="0.01 0.3"/></body>
<body pos="0 0 2"><joint name="idle"/><geom size="0.01"/></body></worldbody>
<actuator><motor joint="idle" ctrlrange="-1 1"/></actuator></mujoco>"""
MATERIALS = {"block": Material(speed=1.0, density=100.0)}
OPTIONS: dict[str, Any] = {"resolution": N, "backend": "cpu"}
SPACE = gymnasium.spaces.Box(-np.inf, np.inf, (8,))


class BallEnv(MujocoEnv):
    """As Gymnasium's own: five physics steps at once."""

    metadata = {"render_modes": ["rgb_array", "depth_array"], "render_fps": 100}  # noqa: RUF012

    def __init__(self, path: Path, **options: Any) -> None:
        super().__init__(str(path), 5, SPACE, width=64, height=48, **options)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        self.do_simulation(action, self.frame_skip)
        return self.data.qpos.copy(), 0.0, False, False, {"height": self.data.qpos[2]}

    def reset_model(self) -> np.ndarray:
        return self.data.qpos.copy()


class NewModelEnv(gymnasium.Env):
    """Another's: no `MujocoEnv`, a loop of its own, and a new model for each episode."""

    observation_space, action_space = SPACE, gymnasium.spaces.Box(-1, 1, (1,))

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
def test_each_physics_step_counts(kind: type, path: Path) -> None:
    env = RippleWrapper(kind(path) if kind is BallEnv else kind(), MATERIALS, **OPTIONS)
    model = mujoco.MjModel.from_xml_string(MODEL)
    data, ripples = mujoco.MjData(model), Ripples(model, MATERIALS, **OPTIONS)
    for _ in range(2):
        env.reset()
        mujoco.mj_resetData(model, data)
        given = 0.0
        with warnings.catch_warnings():
            warnings.simplefilter("error", RippleWarning)
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
    assert info["impulses"] == []
    assert not info["heights"]["block"].any()
    assert env.ripples["block"].time == 0.0


def test_frames_show_the_ripples_in_the_size_of_the_environment(path: Path) -> None:
    near = {"distance": 0.7, "lookat": np.zeros(3)}
    ball = BallEnv(path, render_mode="rgb_array", default_camera_config=near)
    env = RippleWrapper(ball, MATERIALS, looks={"block": "jelly"}, **OPTIONS)
    env.reset()
    env.step(np.zeros(1))
    flat = env.render()
    assert flat.shape == (48, 64, 3)
    assert flat.dtype == np.uint8
    env.ripples["block"].velocity = np.random.default_rng(2).standard_normal((6, N, N)) / 10
    env.ripples["block"].step(0.02)
    assert np.abs(env.render().astype(int) - flat).mean() > 1
    env.close()


def test_modes_without_ripples_say_so(path: Path) -> None:
    with pytest.warns(RippleWarning, match="'depth_array', which shows no ripples"):
        RippleWrapper(BallEnv(path, render_mode="depth_array"), MATERIALS, **OPTIONS)


def test_environments_in_parallel(path: Path) -> None:
    envs = gymnasium.vector.SyncVectorEnv([lambda: RippleWrapper(BallEnv(path), MATERIALS, **OPTIONS)] * 2)
    envs.reset(seed=1)
    for _ in range(20):
        *_, info = envs.step(np.zeros((2, 1)))
    assert info["heights"]["block"].shape == (2, 6, N, N)
    assert info["heights"]["block"][1].any()
    envs.close()


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_gymnasium_finds_no_fault_with_its_own_ant() -> None:
    env = RippleWrapper(gymnasium.make("Ant-v5"), {"torso_geom": Material(density=100.0)}, **OPTIONS)
    check_env(env, skip_render_check=True)
    made = gymnasium.make(env.spec)
    assert isinstance(made, RippleWrapper)
    assert list(made.ripples) == ["torso_geom"]


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_pickled_environment_begins_anew() -> None:
    env = RippleWrapper(gymnasium.make("Ant-v5"), {"torso_geom": Material(density=100.0)}, **OPTIONS)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    again = pickle.loads(pickle.dumps(env))
    assert list(again.ripples) == ["torso_geom"]
    assert again.ripples["torso_geom"].atlas.areas.shape[-1] == N
    assert again.ripples["torso_geom"].time == 0.0 < env.ripples["torso_geom"].time


def test_environments_without_a_model_are_refused() -> None:
    with pytest.raises(RippleError, match=r"CartPole.* has no `model` and `data`; valid are MuJoCo environments"):
        RippleWrapper(gymnasium.make("CartPole-v1"), MATERIALS)


def test_without_gymnasium_the_message_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("ripple_sim.gymnasium")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    with pytest.raises(ImportError, match=r"pip install 'ripple-sim\[gymnasium\]'"):
        importlib.import_module("ripple_sim.gymnasium")
