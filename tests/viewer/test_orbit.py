"""The orbiting camera stays level and off the vertical."""

import numpy as np
import pytest
import pyvista as pv

from ripple_sim.viewer.canvas import level

FOCUS = np.array([0.3, -0.1, 0.5])


def camera(offset: list[float], up: tuple[float, float, float] = (0.3, 0.2, 0.9)) -> pv.Camera:
    made = pv.Camera()
    made.focal_point, made.position, made.up = FOCUS, FOCUS + offset, up
    return made


def elevation(made: pv.Camera) -> float:
    x, y, z = np.array(made.position) - FOCUS
    return float(np.degrees(np.arctan2(z, np.hypot(x, y))))


@pytest.mark.parametrize("offset", [[1, 2, 0.5], [-3, 0, -4], [0, 1, 20]])
def test_a_camera_that_is_not_steep_stays_where_it_is_and_is_made_level(offset: list[float]) -> None:
    made = camera(offset)
    level(made)
    np.testing.assert_allclose(made.position, FOCUS + offset)
    assert tuple(made.up) == (0, 0, 1)


@pytest.mark.parametrize("offset", [[0.01, 0.02, 5], [-1e-9, 0, -3], [0.1, 0, 20]])
def test_a_steep_camera_keeps_its_distance_and_direction_at_88_degrees(offset: list[float]) -> None:
    made = camera(offset)
    level(made)
    assert abs(elevation(made)) == pytest.approx(88.0)
    assert np.sign(elevation(made)) == np.sign(offset[2])
    away = np.array(made.position) - FOCUS
    assert np.linalg.norm(away) == pytest.approx(np.linalg.norm(offset))
    np.testing.assert_allclose(away[:2] / np.hypot(*away[:2]), np.array(offset[:2]) / np.hypot(*offset[:2]), atol=1e-6)
    before = made.position
    level(made)
    np.testing.assert_allclose(made.position, before)  # again: nothing


@pytest.mark.parametrize("height", [4.0, -4.0])
def test_a_camera_straight_above_or_below_keeps_what_was_up_in_the_frame(height: float) -> None:
    made = camera([0, 0, height], up=(0.6, 0.8, 0.0))
    level(made)
    assert elevation(made) == pytest.approx(np.copysign(88.0, height))
    away = np.array(made.position) - FOCUS
    assert np.linalg.norm(away) == pytest.approx(4.0)
    right = np.cross(-away, [0, 0, 1])
    np.testing.assert_allclose(
        right / np.linalg.norm(right), np.cross([0, 0, -np.sign(height)], [0.6, 0.8, 0]), atol=1e-9
    )


def test_a_camera_straight_above_without_any_heading_looks_along_y() -> None:
    made = camera([0, 0, 2.0], up=(0, 0, 1))
    level(made)
    assert elevation(made) == pytest.approx(88.0)
    assert made.position[1] < FOCUS[1]
