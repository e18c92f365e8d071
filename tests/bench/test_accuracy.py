"""The measured accuracy is that of the theory: second order for fem, none for the paper's formula."""

import numpy as np
import pytest
from modes import mode_error

from ripple_sim.bench.report import energy_drift, sphere_mode_error, sphere_modes
from ripple_sim.solver.operator.assembly import OPERATORS


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
