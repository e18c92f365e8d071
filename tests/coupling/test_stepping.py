"""`StepClock` sees time and resets by a mark; MuJoCo's warnings and errors become ours."""

import copy
import warnings

import mujoco
import numpy as np
import pytest

from ripple_sim.coupling import Passed, Ripples, SolvedForces, StepClock, adopt_warnings
from ripple_sim.errors import RippleWarning, SimulationError
from ripple_sim.solver import Material

DT = 0.002


class Watch:
    """A clock on data whose time is set by hand."""

    def __init__(self) -> None:
        self.model = mujoco.MjModel.from_xml_string(f'<mujoco><option timestep="{DT}"/></mujoco>')
        self.data = mujoco.MjData(self.model)
        self.clock = StepClock()

    def at(self, time: float) -> Passed:
        self.data.time = time
        return self.clock.look(self.model, self.data)


def test_the_first_call_counts_as_one_step_unless_time_is_0() -> None:
    assert Watch().at(3.7) == Passed(DT)
    watch = Watch()
    assert watch.at(0.0) == Passed(0.0)
    assert watch.at(DT) == Passed(DT)


def test_elapsed_times_are_exact_for_whole_steps() -> None:
    watch = Watch()
    watch.at(0.1)
    assert watch.at(0.1 + DT) == Passed(DT)
    assert watch.at(0.1 + DT) == Passed(0.0)
    assert watch.at(0.1 + 1.5 * DT).elapsed == pytest.approx(0.5 * DT)


def test_a_shorter_time_step_is_no_missed_one() -> None:
    watch = Watch()
    watch.at(0.1)
    watch.model.opt.timestep = DT / 4
    assert watch.at(0.1 + DT).missed == 0
    assert watch.at(0.1 + 2 * DT).missed == 3


def test_time_set_back_begins_anew() -> None:
    watch = Watch()
    watch.at(1.0)
    assert watch.at(0.5) == Passed(DT, reset=True)
    assert watch.at(0.5 + DT) == Passed(DT)
    watch.clock.restart()
    assert watch.at(9.0) == Passed(DT)


BALL = '<body><freejoint/><geom size="1"/></body>'


def crowd(memory: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Many balls in one place, whose contacts need more memory than they get."""
    text = f'<mujoco><size memory="{memory}"/><worldbody>{40 * BALL}</worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(text)
    return model, mujoco.MjData(model)


def test_a_warning_with_another_time_is_given_once() -> None:
    adopt_warnings()
    model, data = crowd("300K")
    with warnings.catch_warnings(record=True, action="always") as said:
        for _ in range(3):
            mujoco.mj_step(model, data)
    assert sum("Too many contacts" in str(each.message) for each in said) == 1
    assert all(
        each.category is RippleWarning and str(each.message).startswith("MuJoCo: ") for each in said
    )


def test_ripples_adopt_warnings_and_leave_a_handler_that_the_user_has_set() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom name="g" size="1"/></worldbody></mujoco>'
    )
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


def test_error_about_little_memory_names_the_setting_to_enlarge() -> None:
    model, data = crowd("60K")
    ripples = Ripples(model, {0: Material(density=1.0)}, resolution=8)
    said = r'MuJoCo cannot go on: .*out of memory.*; enlarge <size memory="\.\.\."/>'
    with pytest.raises(SimulationError, match=said):
        ripples.mj_step(data)


MODEL = """<mujoco><option integrator="{}"><flag fwdinv="{}"/></option><worldbody>
<geom type="plane" size="1 1 1"/>
<body pos="0 0 0.1"><freejoint/><geom size="0.1"/></body></worldbody>
<keyframe><key time="3.5"/></keyframe></mujoco>"""


def made(
    integrator: str = "Euler", fwdinv: str = "disable"
) -> tuple[mujoco.MjModel, mujoco.MjData, StepClock]:
    model = mujoco.MjModel.from_xml_string(MODEL.format(integrator, fwdinv))
    data = mujoco.MjData(model)
    clock = StepClock()
    mujoco.mj_step(model, data)
    assert goes_on(clock, model, data)
    return model, data, clock


def goes_on(clock: StepClock, model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Whether the clock saw no reset. The time stays the same, so only the mark can show one."""
    data.time = 1.0
    return not clock.look(model, data).reset


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
def test_mark_survives_steps_and_copies(integrator: str) -> None:
    model, data, clock = made(integrator)
    mujoco.mj_step(model, data, 50)
    mujoco.mj_forward(model, data)
    assert goes_on(clock, model, data)
    assert goes_on(clock, model, copy.copy(data))


def test_several_clocks_see_the_same_resets() -> None:
    model, data, first = made()
    second = StepClock()
    assert goes_on(second, model, data)
    for order in ((first, second), (second, first)):
        mujoco.mj_resetData(model, data)
        assert [goes_on(clock, model, data) for clock in order] == [False, False]
        assert [goes_on(clock, model, data) for clock in order] == [True, True]


def test_solver_fwdinv_stays_mujocos_if_mujoco_uses_it() -> None:
    model, data, clock = made(fwdinv="enable")
    mujoco.mj_step(model, data, 20)
    assert goes_on(clock, model, data)
    assert (data.solver_fwdinv >= 0).all()


@pytest.mark.filterwarnings("ignore:MuJoCo")
def test_automatic_resets_are_seen_without_a_mark() -> None:
    model, data, clock = made(fwdinv="enable")
    data.qvel[:] = np.nan
    mujoco.mj_step(model, data)
    assert not goes_on(clock, model, data)
    mujoco.mj_step(model, data)
    assert goes_on(clock, model, data)


TUMBLING = """<mujoco><option solver="{}" integrator="{}" noslip_iterations="{}"><flag sleep="{}"/>
</option><worldbody>
<geom type="plane" size="2 2 1"/><geom type="box" size="0.6 0.1 0.1" pos="0 0.2 0.1"/>
<body pos="0 0 0.2"><freejoint/><geom type="box" size="0.1 0.08 0.06"/></body>
<body pos="0.05 0 0.4"><freejoint/><geom type="capsule" size="0.05 0.1"/>
<body pos="0 0 0.2"><joint/><geom size="0.06"/></body></body>
<body mocap="true" pos="0.3 0.1 0.1"><geom size="0.1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("solver", ["PGS", "CG", "Newton"])
@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicitfast"])
@pytest.mark.parametrize(("noslip", "sleep"), [(0, "disable"), (3, "disable"), (0, "enable")])
def test_data_after_a_step_is_returned_unchanged(
    solver: str, integrator: str, noslip: int, sleep: str
) -> None:
    model = mujoco.MjModel.from_xml_string(TUMBLING.format(solver, integrator, noslip, sleep))
    data = mujoco.MjData(model)
    solved = SolvedForces(model)
    for step in range(400):
        data.mocap_pos[0, 2] = 0.1 + 0.05 * np.sin(0.1 * step)
        mujoco.mj_step(model, data)
        assert solved.find(data) == (data, None)


def test_forces_that_are_solved_already_stay_the_same() -> None:
    model = mujoco.MjModel.from_xml_string(TUMBLING.format("Newton", "Euler", 0, "disable"))
    data = mujoco.MjData(model)
    solved = SolvedForces(model)
    for _ in range(200):
        mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        found, unsolved = solved.find(data)
        assert not unsolved
        np.testing.assert_allclose(found.efc_force, data.efc_force, rtol=1e-6, atol=1e-6)
