"""MuJoCo's sleeping bodies have no contacts, but they still press."""

import mujoco
import numpy as np
import pytest
from hits import Run
from unfiltered import rms

from ripple_sim import Material

GRAVITY = 9.81
MATERIAL = Material(speed=0.6, damping=20.0, stiffness=1000.0, viscosity=3e-4, density=100.0)
pytestmark = pytest.mark.filterwarnings("ignore:the waves on geom")


def model_of(
    target: str = "", solref: str = "0.02 1", tolerance: float = 1e-4, flag: str = "enable"
) -> mujoco.MjModel:
    """Two boxes on one another, on a plate that is static, or stands on a floor."""
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002" sleep_tolerance="{tolerance}"><flag sleep="{flag}"/>
        </option>
        <default><geom solref="{solref}"/></default><worldbody>
        <geom type="plane" size="3 3 .1" pos="0 0 -0.2"/>
        <body>{target}<geom name="target" type="box" size="0.3 0.3 0.1" pos="0 0 -0.1" mass="50"/>
        </body>
        <body pos="0 0 0.041"><freejoint/>
        <geom name="low" type="box" size="0.06 0.05 0.04" mass="0.5"/></body>
        <body pos="0 0 0.122"><freejoint/><geom type="box" size="0.06 0.05 0.04" mass="0.5"/></body>
        </worldbody></mujoco>"""
    )


def asleep(model: mujoco.MjModel, time: float = 1.0) -> Run:
    """A run up to a time [s], at which all bodies sleep."""
    return still_asleep(Run(model, "target", material=MATERIAL), time)


def still_asleep(run: Run, time: float) -> Run:
    run.until(time)
    assert not run.data.ncon and (run.data.tree_asleep >= 0).all()
    return run


def weight(run: Run) -> float:
    """That the springs under the surface bear [N], where they bear no floor."""
    waves = run.ripples["target"]
    return -float(
        (waves.operator.mass * MATERIAL.stiffness * waves.height.astype(np.float64)).sum()
    )


@pytest.mark.parametrize(
    ("solref", "tolerance"), [("0.02 1", 1e-4), ("0.01 0.2", 0.03)], ids=["calm", "chattering"]
)
def test_a_sleeping_body_keeps_its_dimple_and_presses(solref: str, tolerance: float) -> None:
    run = asleep(model_of("", solref, tolerance), 2.0)
    [impulse] = run.hits[-1]
    assert (impulse.geom, impulse.other) == ("target", "low")
    chatter = 0.2 if tolerance > 0.01 else 1e-3
    assert impulse.impulse == pytest.approx(GRAVITY * 0.002, rel=chatter)
    np.testing.assert_allclose(impulse.point, [0, 0, 0], atol=0.01)
    assert weight(run) == pytest.approx(GRAVITY, rel=chatter)
    assert rms(run.ripples["target"]) < 1e-5


def test_a_sleeping_target_is_loaded_by_body_and_floor() -> None:
    impulses = {hit.other: hit.impulse for hit in asleep(model_of("<freejoint/>"), 1.5).hits[-1]}
    assert len(impulses) == 2
    assert impulses.pop("low") == pytest.approx(GRAVITY * 0.002, rel=1e-3)
    assert impulses.popitem()[1] == pytest.approx(51 * GRAVITY * 0.002, rel=1e-3)


def test_a_body_that_was_moved_away_in_its_sleep_presses_no_more() -> None:
    run = asleep(model_of())
    run.data.qpos[[0, 7]] = 1.0  # beside the target, above the floor
    assert not run.until(1.1).hits[-1]
    assert not still_asleep(run, 2.5).hits[-1]
    assert abs(weight(run)) < 1e-3


def test_a_body_that_is_woken_by_a_hit_passes_it_on() -> None:
    run = asleep(model_of())
    run.data.qvel[2], still = -1.0, rms(run.ripples["target"])
    assert sum(hit.impulse for hit in run.until(1.05).hits[-1]) >= 0
    assert rms(run.ripples["target"]) > 100 * still


def test_a_reset_forgets_sleeping_bodies() -> None:
    run = asleep(model_of())
    mujoco.mj_resetData(run.model, run.data)
    run.data.qpos[[2, 9]] = 0.5, 1.0
    assert not run.step()
    assert not run.ripples["target"].height.any()


@pytest.mark.parametrize("depth", [0.0, 5e-4])
def test_bodies_that_start_asleep_press_from_the_beginning(depth: float) -> None:
    box = '<freejoint/><geom type="box" size="0.04 0.05 0.04" mass="0.5"/>'
    heights = 0.04 - depth, 0.12 - 2 * depth, 0.3  # the last one in mid-air
    bodies = "".join(f'<body pos="0 0 {z}" sleep="init">{box}</body>' for z in heights)
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.002"><flag sleep="enable"/></option><worldbody>
        <geom name="target" type="box" size="0.3 0.3 0.1" pos="0 0 -0.1"/>{bodies}</worldbody>
        </mujoco>"""
    )
    run = Run(model, "target", material=MATERIAL)
    [impulse] = run.step()
    assert impulse.impulse == pytest.approx(GRAVITY * 0.002, rel=1e-3)
    np.testing.assert_allclose(impulse.point, [0, 0, 0], atol=1e-3)
    assert weight(still_asleep(run, 2.0)) == pytest.approx(GRAVITY, rel=1e-3)


def test_ripples_that_begin_late_find_sleeping_bodies() -> None:
    run = asleep(model_of())
    run.ripples.reset()
    [impulse] = run.until(1.1).hits[-1]
    assert impulse.other == "low"
    assert impulse.impulse == pytest.approx(GRAVITY * 0.002, rel=1e-3)
