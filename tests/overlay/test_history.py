"""Bounded histories."""

import numpy as np
import pytest

from ripple_sim.overlay.notes import MOST_POINTS, History


@pytest.mark.parametrize("frames", [1, 7, MOST_POINTS, MOST_POINTS + 1, 50 * MOST_POINTS + 3])
def test_history_is_bounded_and_keeps_the_peaks(frames: int) -> None:
    history, values = History(frames), np.random.default_rng(frames).random(frames)
    for value in values:
        history.add(value)
    at, kept = history.curve()
    assert len(at) == len(kept) <= MOST_POINTS
    assert kept.max() == values.max()
    assert at[-1] <= frames - 1
    if frames <= MOST_POINTS:
        np.testing.assert_array_equal(kept, values)
