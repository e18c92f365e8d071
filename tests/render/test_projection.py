"""Projections: where points land in the frame, and which depth they get."""

import numpy as np
import pytest

from ripple_sim.render.camera import Camera, Pose, orthographic, perspective, view_matrix

CAMERAS = [
    Camera((0.0, 0.0, 0.0), 2.0, 0.0, 0.0),
    Camera((0.3, -1.2, 0.7), 5.0, 130.0, -35.0),
    Camera((-4.0, 0.0, 2.0), 0.1, -45.0, 80.0),
]


def projected(matrix, points):
    clip = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return clip[:, :3] / clip[:, 3:], clip[:, 3]


@pytest.mark.parametrize("camera", CAMERAS)
def test_the_view_keeps_distances_and_handedness(camera):
    view = view_matrix(camera.pose())
    points = np.random.default_rng(0).normal(size=(20, 3))
    seen = points @ view[:3, :3].T + view[:3, 3]
    np.testing.assert_allclose(
        np.linalg.norm(seen[:, None] - seen, axis=2), np.linalg.norm(points[:, None] - points, axis=2), atol=1e-12
    )
    assert np.linalg.det(view[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_array_equal(view[3], [0, 0, 0, 1])


@pytest.mark.parametrize("camera", CAMERAS)
def test_the_eye_is_the_origin_and_the_focus_lies_straight_ahead(camera):
    pose = camera.pose()
    view = view_matrix(pose)
    np.testing.assert_allclose(view @ [*pose.eye, 1.0], [0, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(view @ [*camera.lookat, 1.0], [0, 0, -camera.distance, 1], atol=1e-12)


@pytest.mark.parametrize("fovy", [5.0, 45.0, 120.0])
@pytest.mark.parametrize("aspect", [0.5, 1.0, 16 / 9])
def test_corners_of_the_frustum_are_corners_of_clip_space(fovy, aspect):
    near, far = 0.3, 70.0
    half = np.tan(np.radians(fovy) / 2) * np.array([aspect, 1.0])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    depth = np.where(corners[:, 2] < 0, near, far)
    points = np.column_stack([corners[:, :2] * half * depth[:, None], -depth])
    shown, w = projected(perspective(fovy, aspect, near, far), points)
    np.testing.assert_allclose(shown, corners, atol=1e-12)
    np.testing.assert_allclose(w, depth)  # what attributes are divided by is the distance along the axis


def test_depths_grow_with_distance_and_points_behind_the_eye_have_no_place():
    matrix = perspective(45.0, 1.0, 0.1, 100.0)
    away = np.geomspace(0.1, 100.0, 50)
    shown, _ = projected(matrix, np.column_stack([0 * away, 0 * away, -away]))
    assert (np.diff(shown[:, 2]) > 0).all()
    assert (matrix @ [0.0, 0.0, 1.0, 1.0])[3] < 0


@pytest.mark.parametrize("lens", [(0.05, 0.0), (0.0, -0.08), (-0.03, 0.04)])
def test_points_in_the_plane_of_focus_stay_in_the_frame_from_all_over_the_lens(lens):
    middle = CAMERAS[1].pose()
    focal, near, far = 3.0, 0.1, 50.0

    def place(pose: Pose, points):
        return projected(perspective(pose.fovy, 1.5, near, far, pose.shear) @ view_matrix(pose), points)[0]

    rng = np.random.default_rng(1)
    sideways = rng.uniform(-1, 1, (30, 2))
    beside = Pose(middle.position, middle.rotation, middle.distance, middle.fovy, lens, focal)
    for depth, stays in ((focal, True), (0.5 * focal, False), (2 * focal, False)):
        points = middle.position + np.column_stack([sideways, np.full(30, -depth)]) @ middle.rotation.T
        moved = (place(beside, points) - place(middle, points))[:, :2]
        scale = 1 / np.tan(np.radians(middle.fovy) / 2)
        # similar triangles: the ray through the lens meets the plane of focus where the one through its middle does
        blur = np.multiply([scale / 1.5, scale], lens) * (1 / focal - 1 / depth)
        np.testing.assert_allclose(moved, np.tile(blur, (30, 1)), atol=1e-12)
        assert (np.abs(moved).max() < 1e-12) == stays


@pytest.mark.parametrize(("half_width", "depth"), [(1.0, 2.0), (0.02, 7.0), (30.0, 0.5)])
def test_the_orthographic_box_is_clip_space(half_width, depth):
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    points = np.column_stack([corners[:, :2] * half_width, -depth * (corners[:, 2] + 1) / 2])
    shown, w = projected(orthographic(half_width, depth), points)
    np.testing.assert_allclose(shown, corners, atol=1e-12)
    np.testing.assert_array_equal(w, 1.0)
