"""The time between looks, when it goes on, stands still, or begins anew."""

import mujoco
import pytest

from ripple_sim.coupling.stepping import Passed, StepClock, missed_warning

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

    def reset(self) -> None:
        mujoco.mj_resetData(self.model, self.data)


def test_first_look_counts_as_one_step_but_not_before_any() -> None:
    assert Watch().at(3.7) == Passed(DT)
    watch = Watch()
    assert watch.at(0.0) == Passed(0.0)
    assert watch.at(DT) == Passed(DT)


def test_whole_steps_are_exact_and_others_are_kept() -> None:
    watch = Watch()
    watch.at(0.1)
    assert watch.at(0.1 + DT) == Passed(DT)
    assert watch.at(0.1 + DT) == Passed(0.0)
    assert watch.at(0.1 + 1.5 * DT).elapsed == pytest.approx(0.5 * DT)


def test_steps_that_nobody_saw_are_counted() -> None:
    watch = Watch()
    watch.at(0.1)
    assert watch.at(0.1 + 5 * DT) == Passed(5 * DT, missed=4)
    assert "5 physics steps" in str(missed_warning(4))
    assert missed_warning(0) is None


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


@pytest.mark.parametrize("after", [0.0, DT, 7 * DT, 500 * DT])
def test_a_reset_is_seen_whatever_the_time_after_it(after: float) -> None:
    watch = Watch()
    watch.at(DT)
    watch.reset()
    assert watch.at(after) == Passed(DT if after else 0.0, reset=True)
    assert watch.at(after + DT) == Passed(DT)
