"""Races are fair: all take turns, and a ratio is that of turns side by side."""

import itertools
import time

import pytest

from ripple_sim.bench.report import Race, race


class Counts:
    """A contestant that counts, and takes its time."""

    def __init__(self, calls: list[str], name: str) -> None:
        self._calls, self._name = calls, name

    def advance(self, substeps: int, dt: float) -> None:
        self._calls.append(self._name)
        time.sleep(0.01)


def test_contestants_take_turns() -> None:
    calls: list[str] = []
    run = race({name: Counts(calls, name) for name in "abc"}, texels=10, rounds=4)
    turns = [name for name, _ in itertools.groupby(calls)]
    assert turns[-12:] == ["a", "b", "c"] * 4
    assert {name: len(turns) for name, turns in run.seconds.items()} == {"a": 4, "b": 4, "c": 4}


def test_a_slow_round_changes_no_ratio() -> None:
    run = Race(600, {"ours": [2.0, 2.0, 20.0, 2.0, 3.0], "theirs": [6.0, 6.0, 60.0, 5.0, 9.0]})
    assert run.rates() == {"ours": 300, "theirs": 100}
    assert run.ratio("ours", "theirs") == pytest.approx(3)
    assert run.ratio("theirs", "ours") == pytest.approx(1 / 3)
