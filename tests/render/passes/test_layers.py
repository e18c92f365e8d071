"""Transparent objects, over what is behind them.

Boxes in the frame hold whatever shows of a ball, and little else.
"""

import numpy as np
import pytest
from drawn import FLOOR, FRONT, ball_surface, frame_of

from ripple_sim.render import Camera
from ripple_sim.render.camera import Balls, Pose, perspective, view_matrix
from ripple_sim.render.passes.layers import boxes_of


def test_a_transparent_geom_shows_what_is_behind_it(gl):
    wall = '<geom type="box" size="3 .1 3" pos="0 2 0" rgba="0 0 1 1"/>'
    glass = '<geom type="box" size=".5 .02 .5" pos="0 0 .5" rgba="1 0 0 {}"/>'
    middle = np.s_[55:65, 75:85]
    red, mixed, blue = (
        frame_of(gl, wall + pane, camera=FRONT)[middle].mean(axis=(0, 1))
        for pane in (glass.format(1.0), glass.format(0.5), "")
    )
    np.testing.assert_allclose(mixed, (red + blue) / 2, atol=12)


def test_a_transparent_plane_is_drawn_too(gl):
    pane = '<geom type="plane" size=".5 .5 .1" pos="0 0 .5" rgba="1 0 0 .5"/>'
    assert (frame_of(gl, FLOOR + pane) - frame_of(gl, FLOOR))[60, 80, 2] < -40


def test_water_shows_what_is_behind_it_and_clay_does_not(gl):
    """A wall behind the ball tints the middle of the frame through a clear body alone."""

    def middle(look: str, rgba: str) -> np.ndarray:
        body = f'<geom name="t" type="sphere" size="1"/><geom type="box" size="4 .1 4" pos="0 3 0" rgba="{rgba}"/>'
        camera = Camera((0.0, 0.0, 0.0), 4.0, 90.0, 0.0, 40.0)
        frame = frame_of(gl, body, camera=camera, targets={"t": ball_surface(look, 1.0)}, size=(240, 180))
        return frame[80:100, 110:130].mean(axis=(0, 1))

    for look, seen in (("water", True), ("clay", False)):
        change = middle(look, "0 0 1 1") - middle(look, "1 0 0 1")
        assert bool(change[2] > 30) is seen, (look, change)


SIZE = (200, 120)


def pose(seed: int, lens: tuple[float, float] = (0.0, 0.0)) -> Pose:
    rotation, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    rotation[:, 0] *= np.sign(np.linalg.det(rotation))
    return Pose(np.array([0.3, -0.2, 0.5]), rotation, 2.0, 50.0, lens, 2.0)


def pixels(points: np.ndarray, camera: Pose) -> np.ndarray:
    """Where points show [pixels], [k, 2], and how far away along the camera's axis they lie."""
    matrix = perspective(camera.fovy, SIZE[0] / SIZE[1], 0.01, 100.0, camera.shear) @ view_matrix(camera)
    clip = np.c_[points, np.ones(len(points))] @ matrix.T
    return (0.5 + 0.5 * clip[:, :2] / clip[:, 3:]) * SIZE


@pytest.mark.parametrize("lens", [(0.0, 0.0), (0.2, -0.1)])
def test_box_holds_the_ball(lens: tuple[float, float]) -> None:
    camera, random = pose(1, lens), np.random.default_rng(2)
    local = np.stack([random.uniform(-2, 2, 40), random.uniform(-2, 2, 40), random.uniform(-6, -1, 40)], axis=1)
    radii = random.uniform(0.05, 0.6, 40)
    centres = camera.eye + local @ camera.rotation.T
    directions = random.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for centre, radius, box in zip(centres, radii, boxes_of(Balls(centres, radii), camera, SIZE), strict=True):
        shown = np.clip(pixels(centre + radius * directions, camera), 0, SIZE)
        assert (shown >= box[:2]).all() and (shown <= box[2:]).all()


def test_box_of_a_small_ball_is_tight() -> None:
    camera = pose(3)
    centre = camera.eye - 3.0 * camera.rotation[:, 2]
    (box,) = boxes_of(Balls(centre[None], np.array([0.1])), camera, SIZE)
    middle, radius = np.array(SIZE) / 2, 0.1 / 3.0 * SIZE[1] / (2 * np.tan(np.radians(25.0)))
    np.testing.assert_allclose(box, [*(middle - radius), *(middle + radius)], atol=1.3)


def test_the_whole_frame_for_a_ball_about_the_eye_or_an_infinite_one_and_nothing_for_one_behind() -> None:
    camera = pose(4)
    behind = camera.eye + 2.0 * camera.rotation[:, 2]
    centres = np.stack([camera.eye, camera.eye + camera.rotation[:, 0], behind])
    boxes = boxes_of(Balls(centres, np.array([0.5, np.inf, 0.5])), camera, SIZE)
    np.testing.assert_array_equal(boxes[:2], [[0, 0, *SIZE]] * 2)
    assert (boxes[2, :2] == boxes[2, 2:]).all()
