"""The bump's wave on the plane against another way to compute it: Poisson's integral of the initial value problem."""

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.special import i0e

from ripple_sim.bench.arrival import NEAREST, front_and_crest, plane_arrival

FARTHEST = 20.0
SLANTS = np.linspace(0, np.pi / 2, 2001)


def potential(r: float, times: np.ndarray) -> np.ndarray:
    """Integral over s < t of s mean(s) / sqrt(t^2 - s^2), with s = t sin(a); mean over the circle of radius s."""
    s = times[:, None] * np.sin(SLANTS)
    return times * simpson(np.sin(SLANTS) * np.exp(-((r - s) ** 2) / 2) * i0e(r * s), x=SLANTS)


def plane_height(r: float, times: np.ndarray) -> np.ndarray:
    return (potential(r, times + 1e-3) - potential(r, times - 1e-3)) / 2e-3


@pytest.mark.parametrize("distance", [6.0, 11.0])
def test_front_and_crest_come_when_the_initial_value_problem_says(distance: float) -> None:
    times = distance + np.linspace(-3, 2, 101)
    signal = plane_height(distance, times)
    [expected_front], [expected_crest] = front_and_crest(times, signal[:, None])
    (front, _), (crest, _) = plane_arrival(np.array([distance, FARTHEST]))
    assert front == pytest.approx(expected_front, abs=5e-3)
    assert crest == pytest.approx(expected_crest, abs=5e-3)


def test_far_away_the_wave_travels_at_its_speed_and_its_front_leads_the_crest() -> None:
    distance = np.linspace(NEAREST, FARTHEST, 40)
    front, crest = plane_arrival(distance)
    assert (front < crest).all()
    assert (crest < distance).all()  # the half-derivative of a bump leads its middle
    for times in (front, crest):
        np.testing.assert_allclose(np.diff(times) / np.diff(distance), 1.0, atol=0.01)


def test_a_distance_has_the_same_times_whatever_else_is_asked() -> None:
    alone, among = plane_arrival(np.array([8.0])), plane_arrival(np.array([8.0, FARTHEST]))
    for one, other in zip(alone, among, strict=True):
        assert other[0] == pytest.approx(one[0], abs=2e-3)
