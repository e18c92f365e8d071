"""MuJoCo's own warnings are ours, each once, and its errors say what helps."""

import warnings

import mujoco
import pytest

from ripple_sim.coupling.stepping.physics_messages import adopt_warnings, physics_errors
from ripple_sim.errors import RippleWarning, SimulationError

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
