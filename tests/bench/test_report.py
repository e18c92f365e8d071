"""A report can be read.

The measured accuracy is that of the theory: second order for fem, none for the paper's formula.

Tables of the report: aligned columns, and rows for what was measured alone.

Races are fair: all take turns, and a ratio is that of turns side by side.

The bodies of the paper's table 1.
"""

import dataclasses
import itertools
import re
import time

import numpy as np
import pytest
from modes import mode_error

from ripple_sim.bench import report
from ripple_sim.bench.arrival import ArrivalError
from ripple_sim.bench.report import (
    POLYGONS,
    Race,
    as_text,
    energy_drift,
    knobbly_body,
    race,
    sphere_mode_error,
    sphere_modes,
)
from ripple_sim.solver.operator.assembly import OPERATORS

CPU_ROW = {"cpu": 6e8, "naive": 5e8, "naive 1": 2.5e8, "naive prange": 5e8}
CPU_ROW |= {"stream": 8e8, "scipy": 3e7}
CPU_ROW |= {"over naive": 1.2, "one thread over naive": 1.5}
CPU_ROW |= {"of stream": 0.75}
CPU_ROW |= {"one thread over scipy": 12.5}
ERROR = dataclasses.asdict(ArrivalError(0.004, 0.01, 0.99, 0.01, 0.02, 0.95))


def test_report_reads_as_text() -> None:
    sphere = {"16": 0.1, "32": 0.03, "order": 1.9}
    cost = {"touching": 3.2, "mj_step [s]": 2e-3, "coupling [s]": 3e-4, "waves [s]": 2e-4, "of mj_step": 0.15}
    row = {f"steps/s {n}": 1234.5 for n in (20, 28, 40, 56, 128, 256, 512)}
    text = as_text(
        {
            "machine": {"version": "1", "processors": 2, "renderer": "none"},
            "cpu": {"256": CPU_ROW},
            "gl": {"256": None},
            "table": {"2700": row | {"sphere map [s]": 0.1, "atlas 512 [s]": 1.0}},
            "coupling": {"dish": cost},
            "sphere": {"fem": sphere, "paper": {"16": 0.1, "order": 0.0}},
            "energy": {"steps": 10_000, "largest": 1e-7, "trend": -2e-8},
            "arrival": {"cat": {"fem": ERROR, "calibrated": ERROR | {"speed factor": 1.27}, "conformal": None}},
        }
    )
    assert text.index("naive") < text.index("memory bound") < text.index("scipy")  # the true rival first
    cpu = ("1.20", "1.50", "500 (prange)", "0.75", "12.50")
    for figure in (*cpu, "0.300", "1,234", "1.0e-07", "0.40 %", "paper", "x 1.270", "folds"):
        assert figure in text


def test_the_modes_have_errors_for_every_operator_and_ours_is_of_second_order() -> None:
    table = sphere_modes((8, 16, 32))
    assert list(table) == list(OPERATORS)
    assert all(list(row) == ["8", "16", "32", "order"] for row in table.values())
    assert 1.7 < table["fem"]["order"] < 2.6
    assert table["paper"]["order"] < 0.5
    errors = [table["fem"][n] for n in ("8", "16", "32")]
    slope = np.polyfit(np.log([8, 16, 32]), np.log(errors), 1)[0]
    assert table["fem"]["order"] == pytest.approx(-slope)


def test_only_ours_is_measured_beyond_64_texels() -> None:
    table = sphere_modes((16, 32, 65))
    assert "65" in table["fem"]
    assert all("65" not in row for name, row in table.items() if name != "fem")


def test_an_error_is_that_of_the_mode_against_itself_one_period_earlier() -> None:
    assert sphere_mode_error(16) == pytest.approx(mode_error(16), rel=1e-12)
    assert 0 < sphere_mode_error(16) < sphere_mode_error(16, "paper")


def test_energy_and_momentum_stay_within_the_rounding_of_single_precision() -> None:
    drift = energy_drift(12, 1000)
    assert drift["steps"] == 1000
    assert 0 < drift["largest"] < 1e-5
    assert abs(drift["trend"]) <= 2 * drift["largest"]
    assert drift["momentum_change"] < 1e-5


def test_columns_are_aligned_the_first_to_the_left_and_the_others_to_the_right() -> None:
    head, *rows = report._grid(["N", "rate", ""], [["16", "1,234", "x"], ["256", "7", ""]]).splitlines()
    assert (head, rows) == ("N     rate", ["16   1,234  x", "256      7"])


@pytest.mark.parametrize(("one", "parallel", "said"), [(4e6, 5e6, "5 (prange)"), (6e6, 5e6, "6 (one thread)")])
def test_the_faster_of_the_naive_loops_is_named(one: float, parallel: float, said: str) -> None:
    row = {"over naive": 1.0, "one thread over naive": 1.0, "cpu": 9e6}
    text = report._naive({"64": row | {"naive 1": one, "naive": max(one, parallel), "naive prange": parallel}})
    assert text.splitlines()[-1].endswith(said)


def test_operators_without_a_resolution_leave_its_column_empty() -> None:
    text = report._sphere({"fem": {"16": 0.1, "128": 1e-3, "order": 2.0}, "paper": {"16": 0.5, "order": 0.0}})
    head, fem, paper = text.splitlines()[-3:]
    assert re.split(r"\s{2,}", head) == ["operator", "N = 16", "N = 128", "order"]
    assert fem.split() == ["fem", "0.1", "0.001", "2"]
    assert paper.split() == ["paper", "0.5", "0"]
    assert len(paper) == len(fem) == len(head)


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


@pytest.mark.parametrize("count", POLYGONS)
def test_bodies_have_the_polygons_they_are_asked_for(count: int) -> None:
    assert len(knobbly_body(count).F) == count
