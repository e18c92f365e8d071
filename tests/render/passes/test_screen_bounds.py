"""Which part of the picture a ball may show in: all that shows of the ball lies there, and little else."""

import numpy as np
import pytest

from ripple_sim.render.bounds import Balls, balls_about
from ripple_sim.render.camera import Pose
from ripple_sim.render.passes.screen_bounds import boxes_of
from ripple_sim.render.passes.tiles import Tiles
from ripple_sim.render.projection import perspective, view_matrix

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


def test_whole_picture_for_a_ball_about_the_eye_or_without_end_and_none_for_one_behind() -> None:
    camera = pose(4)
    behind = camera.eye + 2.0 * camera.rotation[:, 2]
    centres = np.stack([camera.eye, camera.eye + camera.rotation[:, 0], behind])
    boxes = boxes_of(Balls(centres, np.array([0.5, np.inf, 0.5])), camera, SIZE)
    np.testing.assert_array_equal(boxes[:2], [[0, 0, *SIZE]] * 2)
    assert (boxes[2, :2] == boxes[2, 2:]).all()


class Buffer:
    """Stands for a buffer on the GPU."""

    def write(self, data: bytes) -> None:
        self.corners = np.frombuffer(data, dtype="f4").reshape(-1, 2)


class Context:
    """Makes buffers."""

    def buffer(self, **_: object) -> Buffer:
        return Buffer()


def test_tiles_cover_the_boxes_once_and_little_more() -> None:
    tiles = Tiles(Context(), SIZE)
    boxes = np.array([[10, 20, 60, 50], [40, 40, 64, 64], [150, 100, 200, 120], [70, 70, 70, 70]])
    tiles.cover(boxes)
    shown = np.zeros(SIZE[::-1], dtype=int)
    wanted = np.zeros(SIZE[::-1], dtype=bool)
    for corner in tiles.buffer.corners[: tiles.count]:
        left, lower = np.round((corner + 1) / 2 * SIZE).astype(int)
        right, upper = np.round((corner + tiles.extent + 1) / 2 * SIZE).astype(int)
        shown[lower:upper, left:right] += 1
    for left, lower, right, upper in boxes:
        wanted[lower:upper, left:right] = True
    assert shown.max() == 1
    assert (shown[wanted] == 1).all()
    assert tiles.count == 7


def test_no_tiles_without_boxes() -> None:
    tiles = Tiles(Context(), SIZE)
    tiles.cover(np.zeros((0, 4), dtype=np.int64))
    assert tiles.count == 0


def test_balls_about_triangles_hold_each_and_are_small() -> None:
    random = np.random.default_rng(5)
    angle = random.uniform(0, 2 * np.pi, 300)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(300)], axis=1)
    triangles = ring[:, None] + random.normal(size=(300, 3, 3)) * 0.02
    centres, radii = balls_about(triangles, 16)
    inside = np.linalg.norm(triangles[:, :, None] - centres, axis=3) <= radii + 1e-12
    assert inside.all(axis=1).any(axis=1).all()
    assert len(radii) == 16
    assert radii.max() < 0.4


def test_fewer_triangles_than_balls() -> None:
    triangles = np.random.default_rng(6).normal(size=(3, 3, 3))
    centres, radii = balls_about(triangles, 16)
    middles = (triangles.min(axis=1) + triangles.max(axis=1)) / 2
    np.testing.assert_allclose(np.sort(centres, axis=0), np.sort(middles, axis=0))
    assert len(radii) == 3
