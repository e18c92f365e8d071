"""The time between steps, when it goes on, stands still, or is set back."""

import pytest

from ripple_sim.coupling.clock import StepClock

DT = 0.002


def test_first_step_counts_as_one() -> None:
    assert StepClock().elapsed(3.7, DT) == (DT, False)


def test_whole_steps_are_exact_and_others_are_kept() -> None:
    clock = StepClock()
    clock.elapsed(0.1, DT)
    assert clock.elapsed(0.1 + DT, DT) == (DT, False)
    assert clock.elapsed(0.1 + 4 * DT, DT) == (3 * DT, False)
    assert clock.elapsed(0.1 + 4 * DT, DT) == (0.0, False)
    assert clock.elapsed(0.1 + 4.5 * DT, DT)[0] == pytest.approx(0.5 * DT)


def test_time_set_back_begins_anew() -> None:
    clock = StepClock()
    clock.elapsed(1.0, DT)
    assert clock.elapsed(0.5, DT) == (DT, True)
    assert clock.elapsed(0.5 + 2 * DT, DT) == (2 * DT, False)
    clock.reset()
    assert clock.elapsed(9.0, DT) == (DT, False)
