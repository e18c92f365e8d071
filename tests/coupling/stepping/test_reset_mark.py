"""The mark stays through steps and copies, is wiped out by any reset, and is shared by those who look at it."""

import copy
import pickle

import mujoco
import pytest

from ripple_sim.coupling.stepping import ResetMark

MODEL = """<mujoco><option integrator="{}"><flag fwdinv="{}"/></option><worldbody><geom type="plane" size="1 1 1"/>
<body pos="0 0 0.1"><freejoint/><geom size="0.1"/></body></worldbody>
<keyframe><key time="3.5"/></keyframe></mujoco>"""


def made(integrator: str = "Euler", fwdinv: str = "disable") -> tuple[mujoco.MjModel, mujoco.MjData, ResetMark]:
    model = mujoco.MjModel.from_xml_string(MODEL.format(integrator, fwdinv))
    data, mark = mujoco.MjData(model), ResetMark()
    mujoco.mj_step(model, data)
    assert mark.stands(model, data)
    return model, data, mark


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
def test_it_stands_through_steps_and_copies(integrator: str) -> None:
    model, data, mark = made(integrator)
    mujoco.mj_step(model, data, 50)
    mujoco.mj_forward(model, data)
    assert mark.stands(model, data)
    assert mark.stands(model, copy.copy(data))


def test_every_kind_of_reset_wipes_it_out(in_tmp_path: None) -> None:
    model, data, mark = made()
    mujoco.mj_resetData(model, data)
    assert not mark.stands(model, data)
    assert mark.stands(model, data)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    assert not mark.stands(model, data)
    data.qvel[0] = 1e12  # MuJoCo resets itself
    mujoco.mj_step(model, data)
    assert not mark.stands(model, data)
    assert not mark.stands(model, mujoco.MjData(model))


def test_several_who_look_see_the_same_resets() -> None:
    model, data, first = made()
    second = ResetMark()
    assert second.stands(model, data)
    for order in ((first, second), (second, first)):
        mujoco.mj_resetData(model, data)
        assert [mark.stands(model, data) for mark in order] == [False, False]
        assert [mark.stands(model, data) for mark in order] == [True, True]


def test_pickling_is_no_reset() -> None:
    model, data, mark = made()
    data, mark = pickle.loads(pickle.dumps((data, mark)))
    assert mark.stands(model, data)
    mujoco.mj_resetData(model, data)
    assert not mark.stands(model, data)


def test_there_is_none_where_mujoco_writes_there() -> None:
    model, data, mark = made(fwdinv="enable")
    mujoco.mj_step(model, data, 20)
    assert mark.stands(model, data)
    assert (data.solver_fwdinv >= 0).all()
