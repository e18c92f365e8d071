"""The table of eigenvalues in the documentation is that of a whole run of its benchmark, by today's operator."""

from pathlib import Path

import numpy as np
import pytest
from eigenvalues import cases, mean_error, of_polyhedron

from ripple_sim.solver import build_atlas

DOCS = Path(__file__).parents[2] / "docs"


def test_the_printed_table_is_the_stored_run() -> None:
    run = (DOCS / "runs" / "eigenvalues.txt").read_text(encoding="utf-8")
    assert f"```\n{run}```" in (DOCS / "accuracy.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["hemisphere, fixed", "square, free"])
def test_the_stored_run_is_of_todays_operator(name: str) -> None:
    run = (DOCS / "runs" / "eigenvalues.txt").read_text(encoding="utf-8")
    texels, error, *_ = next(line for line in run.splitlines() if line.startswith(name)).removeprefix(name).split()
    case = cases()[name]
    atlas = build_atlas(case.mesh(), 32, layout="patches")
    assert f"{atlas.areas.size:,}" == texels
    assert mean_error(atlas, case) == pytest.approx(float(error), rel=0.01)


def test_quadratic_elements_have_the_eigenvalues_of_a_flat_square() -> None:
    case = cases()["square, free"]
    np.testing.assert_allclose(of_polyhedron(case.mesh(), 0)[1:], np.sort(case.exact)[1:20], rtol=5e-5)
