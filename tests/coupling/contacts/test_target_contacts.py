"""MuJoCo's contacts, grouped by target and geom, against a search through all of them."""

import numpy as np
import pytest

from ripple_sim.coupling.contacts import group_by_pair


@pytest.mark.parametrize("seed", range(5))
def test_groups_hold_every_contact_of_a_target_once_and_in_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    geoms = np.array([rng.choice(6, 2, replace=False) for _ in range(60)])
    address, is_target = rng.integers(-1, 3, 60), rng.random(6) < 0.5
    expected: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for i, pair in enumerate(geoms.tolist()):
        for side in range(2):
            target, other = pair[side], pair[1 - side]
            if address[i] >= 0 and is_target[target]:
                expected.setdefault((target, other), []).append((i, side))
    pairs = group_by_pair(geoms, address, is_target)
    found = list(zip(pairs.targets.tolist(), pairs.others.tolist(), strict=True))
    assert found == sorted(expected)
    for i, pair in enumerate(found):
        rows = slice(*pairs.begins[i : i + 2])
        assert list(zip(pairs.contacts[rows].tolist(), pairs.sides[rows].tolist(), strict=True)) == expected[pair]


def test_nothing_to_group() -> None:
    pairs = group_by_pair(np.zeros((0, 2), np.int64), np.zeros(0, np.int64), np.ones(3, bool))
    assert [len(each) for each in pairs] == [0, 0, 1, 0, 0]
