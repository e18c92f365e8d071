"""Averaging pixels: in linear light, weighted by opacity."""

import numpy as np
import pytest
from exposed_scene import linear

from ripple_sim.capture.frame_source import Sensor


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


def test_the_sensor_averages_light_over_exposures():
    black, white = np.zeros((2, 3, 3), np.uint8), np.full((2, 3, 3), 255, np.uint8)
    sensor = Sensor(exposures=2)
    for _ in range(2):  # the second frame keeps nothing of the first
        assert sensor.expose(black) is None
        np.testing.assert_array_equal(sensor.expose(white), 188)  # sRGB of half the light


@pytest.mark.parametrize("channels", [3, 4])
def test_the_sensor_averages_codes_and_linear_light_alike(channels):
    codes = np.random.default_rng(6).integers(0, 256, (3, 4, 6, channels), dtype=np.uint8)
    light = linear(codes)
    light[..., 3:] = codes[..., 3:] / 255
    light[..., :3] *= light[..., 3:] if channels == 4 else 1
    sensor, meter = Sensor(2, 3), Sensor(2, 3)
    for number in range(3):
        frame, mean = sensor.expose(codes[number]), meter.expose(light[number].astype(np.float32))
    np.testing.assert_allclose(mean, light.reshape(3, 2, 2, 3, 2, channels).mean(axis=(0, 2, 4)), rtol=1e-5)
    assert frame.dtype == np.uint8
    expected = mean[..., :3] / (mean[..., 3:] if channels == 4 else 1)
    np.testing.assert_allclose(linear(frame)[..., :3], expected, atol=5e-3)
    np.testing.assert_allclose(frame[..., 3:] / 255, mean[..., 3:], atol=2e-3)
