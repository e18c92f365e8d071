"""Averaging pixels: in linear light, weighted by opacity."""

import numpy as np
import pytest

from ripple_sim.capture.sensor import Sensor


def shrink(picture: np.ndarray, factor: int) -> np.ndarray:
    frame = Sensor(factor).expose(picture)
    assert frame is not None
    return frame


@pytest.mark.parametrize("factor", [1, 2, 3])
@pytest.mark.parametrize("channels", [3, 4])
def test_even_areas_keep_their_colour(factor, channels):
    small = np.random.default_rng(1).integers(0, 256, (5, 7, channels), np.uint8)
    small[..., 3:] = 255
    np.testing.assert_array_equal(shrink(small.repeat(factor, axis=0).repeat(factor, axis=1), factor), small)


def test_all_values_survive():
    small = np.arange(256, dtype=np.uint8).reshape(16, 16, 1).repeat(3, axis=2)
    np.testing.assert_array_equal(shrink(small.repeat(2, axis=0).repeat(2, axis=1), 2), small)


def test_black_and_white_average_to_half_the_light():
    frame = np.zeros((2, 2, 3), np.uint8)
    frame[:, 0] = 255
    assert shrink(frame, 2).tolist() == [[[188, 188, 188]]]  # sRGB of 0.5


def test_transparent_pixels_lend_no_colour():
    frame = np.zeros((2, 2, 4), np.uint8)
    frame[0, 0] = (200, 100, 50, 255)
    frame[1, 1] = (0, 255, 0, 0)
    assert shrink(frame, 2).tolist() == [[[200, 100, 50, 64]]]
    assert shrink(np.zeros((2, 2, 4), np.uint8), 2).tolist() == [[[0, 0, 0, 0]]]


def test_linear_light_is_averaged_as_it_is() -> None:
    rng = np.random.default_rng(5)
    pictures = np.exp(rng.uniform(-5, 8, (3, 8, 6, 4))).astype(np.float16)
    sensor = Sensor(factor=2, exposures=3)
    assert sensor.expose(pictures[0]) is None
    assert sensor.expose(pictures[1]) is None
    frame = sensor.expose(pictures[2])
    assert frame is not None
    assert frame.dtype == np.float16
    expected = pictures.astype(float).reshape(3, 4, 2, 3, 2, 4).mean(axis=(0, 2, 4))
    np.testing.assert_allclose(frame, expected, rtol=1e-3)
