"""MuJoCo's own warnings are ours, each once, and its errors say what helps."""

import warnings

import mujoco
import pytest

from ripple_sim.coupling.ripples import Ripples
from ripple_sim.coupling.stepping import adopt_warnings, physics_errors
from ripple_sim.errors import RippleWarning, SimulationError
from ripple_sim.solver import Material

BALL = '<body><freejoint/><geom size="1"/></body>'


def crowd(memory: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Many balls in one place, whose contacts need more memory than they get."""
    text = f'<mujoco><size memory="{memory}"/><worldbody>{40 * BALL}</worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


def test_too_little_memory_names_what_to_enlarge() -> None:
    with (
        pytest.raises(
            SimulationError, match=r'MuJoCo cannot go on: .*out of memory.*; enlarge <size memory="\.\.\."/>'
        ),
        physics_errors(),
    ):
        mujoco.mj_forward(*crowd("60K"))


def test_a_warning_is_given_once_though_it_tells_another_time() -> None:
    adopt_warnings()
    model, data = crowd("300K")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for _ in range(3):
            mujoco.mj_step(model, data)
    texts = [str(each.message) for each in said]
    assert sum("Too many contacts" in text for text in texts) == 1
    assert all(each.category is RippleWarning and str(each.message).startswith("MuJoCo: ") for each in said)


def test_ripples_adopt_warnings_and_leave_a_handler_that_the_user_has_set() -> None:
    model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom name="g" size="1"/></worldbody></mujoco>')
    mujoco.set_mju_user_warning(None)
    Ripples(model, {"g": Material()}, resolution=8)
    with pytest.warns(RippleWarning, match="Too many contacts"):
        mujoco.mj_forward(*crowd("300K"))
    heard: list[str] = []
    mujoco.set_mju_user_warning(heard.append)
    try:
        Ripples(model, {"g": Material()}, resolution=8)
        mujoco.mj_forward(*crowd("300K"))
    finally:
        mujoco.set_mju_user_warning(None)
    assert any("Too many contacts" in each for each in heard)


def test_steps_taken_with_the_waves_name_what_to_enlarge() -> None:
    model, data = crowd("60K")
    ripples = Ripples(model, {0: Material(density=1.0)}, resolution=8)
    with pytest.raises(SimulationError, match="enlarge <size memory"):
        ripples.mj_step(data)
