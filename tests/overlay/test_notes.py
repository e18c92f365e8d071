"""Colour map, heatmaps, baselines, grids, bounded histories, steady limits, short numbers."""

import numpy as np
import pytest
from exposed_scene import linear

from ripple_sim import overlay
from ripple_sim.errors import SceneError
from ripple_sim.overlay import Limit, curve

# Machado, Oliveira and Fernandes 2009, complete deuteranopia and protanopia, on linear RGB
DEUTAN = np.array(
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ]
)
PROTAN = np.array(
    [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ]
)
RGB_TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)


def lab(rgb: np.ndarray) -> np.ndarray:
    xyz = np.clip(rgb, 0, 1) @ RGB_TO_XYZ.T / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def test_colors_diverge_evenly_from_a_bright_middle() -> None:
    table = lab(linear(overlay.color_table().astype(float)))
    lightness = table[:, 0]  # 0 is black, 100 is white
    hues = table[:, 1:]  # 0 is grey
    middle = overlay.SIZE // 2
    assert lightness[middle] > 95
    assert np.abs(hues[middle]).max() < 1
    # both arms are equally light; an eye just sees a difference of 2 to 3
    np.testing.assert_allclose(lightness, lightness[::-1], atol=1.5)
    arm = lightness[middle:]
    assert (np.diff(arm) < 0.3).all()
    assert arm[-1] < 40
    # equal steps of 1/16 of the range look equally large, all through one arm and in both
    steps = np.linalg.norm(np.diff(table[::16], axis=0), axis=1)
    assert steps.max() / steps.min() < 1.25


@pytest.mark.parametrize("vision", [np.eye(3), DEUTAN, PROTAN])
def test_signs_differ_for_every_colour_vision(vision: np.ndarray) -> None:
    seen = lab(linear(overlay.color_table().astype(float)) @ vision.T)
    apart = np.linalg.norm(seen - seen[::-1], axis=1)
    middle = overlay.SIZE // 2
    assert apart[middle + middle // 4] > 15  # a difference of 2 to 3 is just seen
    assert apart[-1] > 50


def test_colors_of_values() -> None:
    table = overlay.color_table()
    np.testing.assert_array_equal(
        overlay.colors([-3.0, -2.0, 0.0, 1.0, 2.0], 2.0), table[[0, 0, 256, 384, 512]]
    )


def test_comparison_names_its_baselines() -> None:
    assert overlay.compared_operators(None) == ("fem",)
    assert overlay.compared_operators("paper") == ("fem", "paper")
    with pytest.raises(SceneError, match="paper, uncorrected, dynamic-paint"):
        overlay.compared_operators("fem")


def test_grid_has_a_readable_number_of_cells() -> None:
    spacing_by_resolution = {8: 1, 16: 1, 24: 1, 32: 2, 96: 4, 128: 8, 256: 16}
    found = {n: overlay.grid_spacing(n) for n in spacing_by_resolution}
    assert found == spacing_by_resolution


@pytest.mark.parametrize(
    "frames", [1, 7, overlay.MOST_POINTS, overlay.MOST_POINTS + 1, 50 * overlay.MOST_POINTS + 3]
)
def test_history_is_bounded_and_keeps_the_peaks(frames: int) -> None:
    values = np.random.default_rng(frames).random(frames)
    at, kept = curve(values, frames)
    assert len(at) == len(kept) <= overlay.MOST_POINTS
    assert kept.max() == values.max()
    assert at[-1] <= frames - 1
    if frames <= overlay.MOST_POINTS:
        np.testing.assert_array_equal(kept, values)


def test_limit_grows_to_round_numbers_and_never_shrinks() -> None:
    limit = Limit(floor=0.0007)
    seen = []
    assert limit.value == limit.goal == 0.0008
    rng = np.random.default_rng(3)
    small = 0.0003 * rng.random(20)
    large = np.full(40, 0.0013)
    small_again = 0.0004 * rng.random(40)
    for magnitude in np.concatenate([small, large, small_again]):
        seen.append(limit.follow(magnitude, 1 / 60))
    assert seen[len(small) - 1] == 0.0008
    assert seen[-1] == limit.goal == 0.0015
    ratios = np.divide(seen[1:], seen[:-1])
    assert (ratios >= 1).all()
    assert ratios.max() < 1.15  # it glides
    assert (np.diff(seen) > 0).sum() < 50  # and stands still again


def test_the_limit_follows_the_values_unless_it_is_fixed() -> None:
    limit = Limit()
    assert [limit.follow(each, 0.1) for each in (0.0, 0.035)] == [0.0, 0.04]
    assert Limit(fixed=0.3).follow(7.0, 0.1) == 0.3
    limit = Limit(floor=0.001)
    assert 1.0 <= limit.follow(3.5, 1 / 60) < 1.5
    assert limit.goal == 4


def test_a_limit_with_memory_ignores_short_peaks() -> None:
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
    assert [overlay.round_up(x) for x in (0.001, 0.0011, 2.1, 81)] == [0.001, 0.0015, 3, 100]
    numbers = [overlay.number(x) for x in (-20.0, 0.0, 2.5, -0.0)]
    assert numbers == ["\N{MINUS SIGN}20", "0", "2.5", "0"]
    scaled = [overlay.readable(x, "m") for x in (2e-6, 0.02, 0.001, 3.0)]
    assert [unit for _, unit in scaled] == ["\N{MICRO SIGN}m", "mm", "mm", "m"]
    factor, _ = overlay.readable(0.02, "m")
    assert factor * 0.02 == pytest.approx(20)
