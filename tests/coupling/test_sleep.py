"""MuJoCo's sleeping bodies have no contacts, but they still press."""

import mujoco
import numpy as np
import pytest
from unfiltered import rms

from ripple_sim import Material, Ripples

GRAVITY = 9.81
MATERIAL = Material(speed=0.6, damping=20.0, stiffness=1000.0, viscosity=3e-4, density=100.0)
pytestmark = pytest.mark.filterwarnings("ignore:the waves on geom")


def model_of(target: str = "", solref: str = "0.02 1", tolerance: float = 1e-4, flag: str = "enable") -> mujoco.MjModel:
    """Two boxes on one another, on a plate that is static, or stands on a floor."""
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002" sleep_tolerance="{tolerance}"><flag sleep="{flag}"/></option>
        <default><geom solref="{solref}"/></default><worldbody><geom type="plane" size="3 3 .1" pos="0 0 -0.2"/>
        <body>{target}<geom name="target" type="box" size="0.3 0.3 0.1" pos="0 0 -0.1" mass="50"/></body>
        <body pos="0 0 0.041"><freejoint/><geom name="low" type="box" size="0.06 0.05 0.04" mass="0.5"/></body>
        <body pos="0 0 0.122"><freejoint/><geom type="box" size="0.06 0.05 0.04" mass="0.5"/></body>
        </worldbody></mujoco>"""
    )


class Run:
    def __init__(self, model: mujoco.MjModel) -> None:
        self.data = mujoco.MjData(model)
        self.ripples = Ripples(model, {"target": MATERIAL}, resolution=12, backend="cpu", conserve_volume=False)
        self.waves = self.ripples["target"]

    def until(self, time: float) -> None:
        while self.data.time < time - 1e-9:
            self.ripples.mj_step(self.data)

    @property
    def asleep(self) -> bool:
        return not self.data.ncon and bool((self.data.tree_asleep >= 0).all())

    def weight(self) -> float:
        """That the springs under the surface bear [N], where they bear no floor."""
        return -float((self.waves.operator.mass * MATERIAL.stiffness * self.waves.height.astype(np.float64)).sum())


@pytest.mark.parametrize(("solref", "tolerance"), [("0.02 1", 1e-4), ("0.01 0.2", 0.03)], ids=["calm", "chattering"])
def test_a_sleeping_body_keeps_its_dimple_and_presses(solref: str, tolerance: float) -> None:
    run = Run(model_of("", solref, tolerance))
    run.until(2.0)
    assert run.asleep
    (impulse,) = run.ripples.last_impulses
    assert (impulse.geom, impulse.other) == ("target", "low")
    chatter = 0.2 if tolerance > 0.01 else 1e-3
    assert impulse.impulse == pytest.approx(GRAVITY * 0.002, rel=chatter)
    np.testing.assert_allclose(impulse.point, [0, 0, 0], atol=0.01)
    assert run.weight() == pytest.approx(GRAVITY, rel=chatter)
    assert rms(run.waves) < 1e-5


def test_a_sleeping_target_is_loaded_by_body_and_floor() -> None:
    run = Run(model_of("<freejoint/>"))
    run.until(1.5)
    assert run.asleep
    impulses = {impulse.other: impulse.impulse for impulse in run.ripples.last_impulses}
    assert len(impulses) == 2
    assert impulses.pop("low") == pytest.approx(GRAVITY * 0.002, rel=1e-3)
    assert impulses.popitem()[1] == pytest.approx(51 * GRAVITY * 0.002, rel=1e-3)


def test_a_body_that_was_moved_away_in_its_sleep_presses_no_more() -> None:
    run = Run(model_of())
    run.until(1.0)
    assert run.asleep
    run.data.qpos[[0, 7]] = 1.0  # beside the target, above the floor
    run.until(1.1)
    assert not run.ripples.last_impulses
    run.until(2.5)
    assert run.asleep
    assert abs(run.weight()) < 1e-3
    assert not run.ripples.last_impulses


def test_a_body_that_is_woken_by_a_hit_passes_it_on() -> None:
    run = Run(model_of())
    run.until(1.0)
    assert run.asleep
    run.data.qvel[2], still = -1.0, rms(run.waves)
    run.until(1.05)
    assert sum(impulse.impulse for impulse in run.ripples.last_impulses) >= 0
    assert rms(run.waves) > 100 * still


def test_a_reset_forgets_sleeping_bodies() -> None:
    run = Run(model_of())
    run.until(1.0)
    assert run.asleep
    mujoco.mj_resetData(run.ripples.model, run.data)
    run.data.qpos[[2, 9]] = 0.5, 1.0
    run.ripples.mj_step(run.data)
    assert not run.ripples.last_impulses
    assert not run.waves.height.any()


@pytest.mark.parametrize("depth", [0.0, 5e-4])
def test_bodies_that_start_asleep_press_from_the_beginning(depth: float) -> None:
    box = '<freejoint/><geom type="box" size="0.04 0.05 0.04" mass="0.5"/>'
    heights = 0.04 - depth, 0.12 - 2 * depth, 0.3  # the last one in mid-air
    bodies = "".join(f'<body pos="0 0 {z}" sleep="init">{box}</body>' for z in heights)
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002"><flag sleep="enable"/></option><worldbody>
        <geom name="target" type="box" size="0.3 0.3 0.1" pos="0 0 -0.1"/>{bodies}</worldbody></mujoco>"""
    )
    run = Run(model)
    run.until(0.002)
    (impulse,) = run.ripples.last_impulses
    assert impulse.impulse == pytest.approx(GRAVITY * 0.002, rel=1e-3)
    np.testing.assert_allclose(impulse.point, [0, 0, 0], atol=1e-3)
    run.until(2.0)
    assert run.asleep
    assert run.weight() == pytest.approx(GRAVITY, rel=1e-3)


def test_ripples_that_begin_late_find_what_sleeps() -> None:
    run = Run(model_of())
    run.until(1.0)
    assert run.asleep
    run.ripples.reset()
    run.until(1.1)
    (impulse,) = run.ripples.last_impulses
    assert impulse.other == "low"
    assert impulse.impulse == pytest.approx(GRAVITY * 0.002, rel=1e-3)
