"""Points on a frame and back, and what hides them."""

import mujoco
import numpy as np
import pytest

from ripple_sim.overlay.panels import Projection
from ripple_sim.render import Camera
from ripple_sim.render.camera import Pose

CAMERA = Camera((0.1, -0.2, 0.3), 4.0, 37.0, -25.0, 50.0)
SCENE = """<mujoco><worldbody><geom type="box" size=".5 .5 .5"/>
<geom name="veil" type="box" size=".01 9 9" pos="2 0 0" group="{}"/></worldbody></mujoco>"""


def ray(pose: Pose, size: tuple[int, int], pixel: np.ndarray) -> np.ndarray:
    """Way from the camera through a pixel, from the angle of view alone."""
    up = np.tan(np.radians(pose.fovy) / 2)
    x, y = (2 * pixel[0] / size[0] - 1) * up * size[0] / size[1], (1 - 2 * pixel[1] / size[1]) * up
    return pose.rotation @ [x, y, -1.0]


@pytest.mark.parametrize("size", [(640, 480), (480, 640), (33, 17)])
def test_points_on_the_ray_through_a_pixel_come_back_to_it(size: tuple[int, int]) -> None:
    pose = CAMERA.pose()
    for pixel in np.random.default_rng(0).uniform(0, size, (20, 2)):
        points = pose.position + np.array([[0.1], [3.0], [400.0]]) * ray(pose, size, pixel)
        np.testing.assert_allclose(Projection(pose, *size).pixels(points), np.tile(pixel, (3, 1)), rtol=1e-9)


def test_the_point_looked_at_is_in_the_middle_and_up_is_up() -> None:
    projection = Projection(CAMERA.pose(), 640, 480)
    middle, above = projection.pixels(np.array(CAMERA.lookat) + np.array([[0, 0, 0], [0, 0, 0.1]]))
    np.testing.assert_allclose(middle, [320, 240])
    assert above[0] == pytest.approx(320)
    assert above[1] < 240


def test_behind_the_camera_nothing_has_a_pixel() -> None:
    pose = CAMERA.pose()
    points = pose.position + np.array([[1.0], [0.0], [-1.0]]) * pose.rotation[:, 2]
    np.testing.assert_array_equal(np.isnan(Projection(pose, 640, 480).pixels(points)).all(axis=1), [True, True, False])


def test_a_length_across_the_view_covers_the_pixels_that_it_should() -> None:
    pose = CAMERA.pose()
    projection = Projection(pose, 640, 480)
    for distance in (0.5, 4.0, 30.0):
        point = pose.position - distance * pose.rotation[:, 2] + 0.1 * pose.rotation[:, 1]
        across = point + 25 * projection.metres(point) * pose.rotation[:, 0]
        one, other = projection.pixels(np.array([point, across]))
        np.testing.assert_allclose(other - one, [25, 0], atol=1e-9)


@pytest.mark.parametrize(("group", "seen"), [(0, False), (2, False), (3, True)])
def test_geoms_of_hidden_groups_hide_nothing(group: int, seen: bool) -> None:
    model = mujoco.MjModel.from_xml_string(SCENE.format(group))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pose = Camera((0, 0, 0), 5.0, 180.0, 0.0).pose()  # at x = 5, looks along -x
    np.testing.assert_allclose(pose.position, [5, 0, 0], atol=1e-12)
    points = np.array([[0.5, 0.1, 0.2], [0.0, 0.0, 0.0], [-2.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    found = Projection(pose, 64, 48).seen(model, data, points)
    np.testing.assert_array_equal(found, [seen, False, False, True])
