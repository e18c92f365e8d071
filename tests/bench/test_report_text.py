"""Tables of the report: aligned columns, and rows for what was measured alone."""

import re

import pytest

from ripple_sim.bench import report


def test_columns_are_aligned_the_first_to_the_left_and_the_others_to_the_right() -> None:
    head, *rows = report._grid(["N", "rate", ""], [["16", "1,234", "x"], ["256", "7", ""]]).splitlines()
    assert (head, rows) == ("N     rate", ["16   1,234  x", "256      7"])


@pytest.mark.parametrize(("one", "parallel", "said"), [(4e6, 5e6, "5 (prange)"), (6e6, 5e6, "6 (one thread)")])
def test_the_faster_of_the_naive_loops_is_named(one: float, parallel: float, said: str) -> None:
    row = {"over naive": 1.0, "one thread over naive": 1.0, "all threads over naive": 1.0, "cpu": 9e6, "threads": 2}
    text = report._naive({"64": row | {"naive 1": one, "naive": max(one, parallel), "naive prange": parallel}})
    assert text.splitlines()[-1].endswith(said)


def test_operators_without_a_resolution_leave_its_column_empty() -> None:
    text = report._sphere({"fem": {"16": 0.1, "128": 1e-3, "order": 2.0}, "paper": {"16": 0.5, "order": 0.0}})
    head, fem, paper = text.splitlines()[-3:]
    assert re.split(r"\s{2,}", head) == ["operator", "N = 16", "N = 128", "order"]
    assert fem.split() == ["fem", "0.1", "0.001", "2"]
    assert paper.split() == ["paper", "0.5", "0"]
    assert len(paper) == len(fem) == len(head)
