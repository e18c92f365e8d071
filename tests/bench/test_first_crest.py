"""Front and first crest of signals whose crests are known."""

import numpy as np
import pytest

from ripple_sim.bench.arrival import front_and_crest

TIMES = np.linspace(0, 4, 401)


def bump(middle: float, width: float = 0.3, height: float = 1.0) -> np.ndarray:
    return height * np.exp(-(((TIMES - middle) / width) ** 2) / 2)


def test_a_parabola_is_found_exactly_between_the_samples() -> None:
    times = np.arange(8.0)
    signal = (9 - (times - 3.3) ** 2)[:, None]
    [front], [crest] = front_and_crest(times, signal)
    assert crest == pytest.approx(3.3, abs=1e-12)
    assert front == pytest.approx(1 + (4.5 - signal[1, 0]) / (signal[2, 0] - signal[1, 0]), abs=1e-12)


@pytest.mark.parametrize("middle", [1.5, 2.003, 2.718])
@pytest.mark.parametrize("height", [1e-6, 1.0, 1e4])
def test_a_bump_has_its_crest_in_the_middle_and_its_front_at_half_height(middle: float, height: float) -> None:
    [front], [crest] = front_and_crest(TIMES, bump(middle, height=height)[:, None])
    assert crest == pytest.approx(middle, abs=1e-4)
    assert front == pytest.approx(middle - 0.3 * np.sqrt(2 * np.log(2)), abs=1e-4)


def test_the_first_of_two_crests_counts_though_the_second_is_higher() -> None:
    [front], [crest] = front_and_crest(TIMES, (bump(1.0, 0.1, 0.5) + bump(3.0, 0.1))[:, None])
    assert crest == pytest.approx(1.0, abs=1e-4)
    assert front == pytest.approx(1.0 - 0.1 * np.sqrt(2 * np.log(2)), abs=1e-3)


@pytest.mark.parametrize(("height", "expected"), [(0.15, 3.0), (0.25, 1.0)])
def test_a_ripple_below_a_fifth_of_the_strongest_is_no_crest(height: float, expected: float) -> None:
    _, [crest] = front_and_crest(TIMES, (bump(1.0, 0.1, height) + bump(3.0, 0.1))[:, None])
    assert crest == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("signal", [np.zeros(401), -bump(2.0), TIMES, -TIMES], ids=["zero", "trough", "rise", "fall"])
def test_without_a_crest_there_is_no_time(signal: np.ndarray) -> None:
    for [time] in front_and_crest(TIMES, signal[:, None]):
        assert np.isnan(time)


def test_signals_side_by_side_do_not_mix() -> None:
    middles = np.array([0.9, 1.7, 2.4])
    signals = np.stack([*(bump(middle) for middle in middles), np.zeros(401)], axis=1)
    fronts, crests = front_and_crest(TIMES, signals)
    np.testing.assert_allclose(crests[:3], middles, atol=1e-4)
    np.testing.assert_allclose(np.diff(fronts[:3]), np.diff(middles), atol=1e-4)
    assert np.isnan([fronts[3], crests[3]]).all()


def test_times_shift_with_the_clock() -> None:
    signal = bump(2.0)[:, None]
    for here, later in zip(front_and_crest(TIMES, signal), front_and_crest(TIMES + 10, signal), strict=True):
        np.testing.assert_allclose(later, here + 10)
