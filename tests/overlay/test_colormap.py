"""The diverging colour map: even steps, a bright middle, for every colour vision."""

import numpy as np
import pytest

from ripple_sim.overlay.notes import SIZE, color_table, colors, lab_to_srgb

# Machado, Oliveira and Fernandes 2009, complete deuteranopia and protanopia, on linear RGB
DEUTAN = np.array([[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]])
PROTAN = np.array([[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]])
RGB_TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


def linear_rgb(srgb: np.ndarray) -> np.ndarray:
    value = srgb / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    xyz = np.clip(rgb, 0, 1) @ RGB_TO_XYZ.T / [0.95047, 1.0, 1.08883]
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def test_colors_diverge_evenly_from_a_bright_middle() -> None:
    table = lab(linear_rgb(color_table().astype(float)))
    middle = SIZE // 2
    assert table[middle, 0] > 95
    assert np.abs(table[middle, 1:]).max() < 1
    np.testing.assert_allclose(table[:, 0], table[::-1, 0], atol=1.5)  # both arms equally light
    lightness = table[middle:, 0]
    assert (np.diff(lightness) < 0.3).all()
    assert lightness[-1] < 40
    # equal steps of 1/16 of the range look equally large, all through one arm and in both
    steps = np.linalg.norm(np.diff(table[::16], axis=0), axis=1)
    assert steps.max() / steps.min() < 1.25


@pytest.mark.parametrize("vision", [np.eye(3), DEUTAN, PROTAN])
def test_signs_are_told_apart_by_every_eye(vision: np.ndarray) -> None:
    seen = lab(linear_rgb(color_table().astype(float)) @ vision.T)
    apart = np.linalg.norm(seen - seen[::-1], axis=1)
    middle = SIZE // 2
    assert apart[middle + middle // 4] > 15  # a difference of 2 to 3 is just seen
    assert apart[-1] > 50


def test_lab_white_and_black() -> None:
    np.testing.assert_allclose(lab_to_srgb(np.array([[100.0, 0, 0], [0, 0, 0]])), [[1, 1, 1], [0, 0, 0]], atol=1e-3)


def test_colors_of_values() -> None:
    table = color_table()
    np.testing.assert_array_equal(colors([-3.0, -2.0, 0.0, 1.0, 2.0], 2.0), table[[0, 0, 256, 384, 512]])
