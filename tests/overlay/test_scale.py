"""Limits that hold still, and short numbers."""

import numpy as np
import pytest

from ripple_sim.overlay.notes import Limit, number, readable, round_up


def test_limit_grows_to_round_numbers_and_never_shrinks() -> None:
    limit, seen = Limit(floor=0.0007), []
    assert limit.value == limit.goal == 0.0008
    rng = np.random.default_rng(3)
    for magnitude_now in np.concatenate([0.0003 * rng.random(20), 0.0013 * np.ones(40), 0.0004 * rng.random(40)]):
        seen.append(limit.follow(magnitude_now, 1 / 60))
    assert seen[19] == 0.0008
    assert seen[-1] == limit.goal == 0.0015
    ratios = np.divide(seen[1:], seen[:-1])
    assert (ratios >= 1).all()
    assert ratios.max() < 1.15  # it glides
    assert (np.diff(seen) > 0).sum() < 50  # and stands still again


def test_limit_without_floor_starts_with_what_it_sees() -> None:
    limit = Limit()
    assert limit.follow(0.0, 0.1) == 0.0
    assert limit.follow(0.035, 0.1) == 0.04
    fixed = Limit(fixed=0.3)
    assert fixed.follow(7.0, 0.1) == 0.3


def test_limit_that_is_far_off_catches_up() -> None:
    limit = Limit(floor=0.001)
    assert 1.0 <= limit.follow(3.5, 1 / 60) < 1.5
    assert limit.goal == 4


def test_limit_with_a_memory_overlooks_what_is_short() -> None:
    limit = Limit(floor=0.01, memory=0.25)
    for _ in range(2):
        limit.follow(0.05, 1 / 60)
    for _ in range(100):
        limit.follow(0.0, 1 / 60)
    assert limit.goal == 0.01
    for _ in range(100):
        limit.follow(0.05, 1 / 60)
    assert limit.goal == 0.05


def test_numbers_are_short() -> None:
    assert [round_up(x) for x in (0.001, 0.0011, 2.1, 81)] == [0.001, 0.0015, 3, 100]
    assert [number(x) for x in (-20.0, 0.0, 2.5, -0.0)] == ["\N{MINUS SIGN}20", "0", "2.5", "0"]
    assert [readable(x, "m")[1] for x in (2e-6, 0.02, 0.001, 3.0)] == ["\N{MICRO SIGN}m", "mm", "mm", "m"]
    assert readable(0.02, "m")[0] * 0.02 == pytest.approx(20)
