"""The exact mode of a layer: limits that are known."""

import numpy as np
import pytest

from ripple_sim.solver.operator.material import lowest_square


def test_short_waves_do_not_feel_the_base_and_run_as_rayleigh_s() -> None:
    """On an incompressible half space x = (c / c_T)^2 solves x^3 - 8 x^2 + 24 x - 16 = 0: 0.9553 c_T."""
    rayleigh = min(root.real for root in np.roots([1, -8, 24, -16]) if abs(root.imag) < 1e-9)
    assert np.sqrt(lowest_square(10.0)) / 10.0 == pytest.approx(np.sqrt(rayleigh), rel=2e-3)


def test_long_waves_do_and_run_faster() -> None:
    speeds = [np.sqrt(lowest_square(q)) / q for q in (1.3, 2.0, 4.0, 8.0)]
    assert np.all(np.diff(speeds) < 0)
    assert speeds[0] > 2
