"""Points, normals, gradients and ambient light that go along with a mesh whose vertices move."""

import numpy as np
import pytest
from mujoco_models import posed
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from surfaces import grid

from ripple_sim import Camera, Material, RippleRenderer, Ripples
from ripple_sim.render.surfaces import MovingOcclusion, MovingVertices
from ripple_sim.render.visuals import (
    bake,
    bounding_radius,
    cast,
    frames_about,
    shapes,
    smooth_normals,
)
from ripple_sim.solver import HeightMap, sphere_atlas
from ripple_sim.solver.waves import MovedGradients

TURN = Rotation.from_rotvec([0.4, -1.1, 0.7])


def occlusion(V, F):
    """That of the vertices themselves, and what is baked at rest."""
    normals = smooth_normals(V, F)
    baked = bake(V, F, normals)
    return MovingOcclusion(V, F, V, normals, baked), baked


def sheet(n):
    """Square sheet of n x n vertices, side 2, normals up."""
    return grid(n - 1, lambda a, b: (2 * a - 1, 2 * b - 1, 0 * a))


def dented(V):
    """A unit ball with a hole from above, and how deep it is [n]."""
    depth = 1.3 * np.exp(-(V[:, 0] ** 2 + V[:, 1] ** 2) / 0.15) * (V[:, 2] > 0)
    return V - depth[:, None] * [0, 0, 1], depth


def rms(values):
    return float(np.sqrt((values**2).mean()))


@pytest.mark.parametrize("divisions", [8, 24])
def test_a_rigid_motion_changes_nothing(divisions):
    ball = shapes.ball(divisions)
    V = ball.shell * (0.4 + 0.6 * ball.shell[:, :1] ** 2)  # with a waist
    moving, baked = occlusion(V, ball.faces)
    assert_allclose(moving(V), baked, atol=1e-6)
    assert_allclose(moving(TURN.apply(V) + np.array([30.0, -20.0, 10.0])), baked, atol=2e-3)


@pytest.mark.parametrize("divisions", [10, 24])
def test_a_moving_dent_darkens_like_a_dent_in_the_mesh(divisions):
    ball = shapes.ball(divisions)
    moving, baked = occlusion(ball.shell, ball.faces)
    V, depth = dented(ball.shell)
    from_scratch = cast(V, ball.faces, frames_about(smooth_normals(V, ball.faces)), 64, 1.0)
    moved = moving(V)
    cavity = depth > 0.6
    assert from_scratch[cavity, 0].mean() < baked[cavity, 0].mean() - 0.3
    assert_allclose(moved[cavity, 0].mean(), from_scratch[cavity, 0].mean(), atol=0.09)
    for column in range(3):
        assert rms(moved[:, column] - from_scratch[:, column]) < 0.25 * rms(
            from_scratch[:, column] - baked[:, column]
        )


@pytest.mark.parametrize("side", [1, -1])
def test_each_side_of_a_sheet_that_curls_has_its_own_light(side):
    """Most of a tube, whose inside sees a part of the sky and whose outside sees all of it."""
    V, F = sheet(40)
    moving, baked = occlusion(V, F)
    assert_allclose(baked[:, [0, 2]], 1.0)
    angle = 2.4 * V[:, 0]
    curled = np.stack([np.sin(angle), 2.4 * V[:, 1], side * (1 - np.cos(angle))], axis=1) / 2.4
    moved = moving(curled)
    inside, outside = (0, 2) if side > 0 else (2, 0)
    middle = (np.abs(V[:, 0]) < 0.5) & (np.abs(V[:, 1]) < 0.5)
    from_scratch = cast(curled, F, frames_about(smooth_normals(curled, F)), 64, bounding_radius(V))
    assert moved[middle, inside].max() < 0.75
    assert_allclose(moved[middle, outside], 1.0, atol=0.01)
    assert rms(moved[:, inside] - from_scratch[:, inside]) < 0.03


def test_light_does_not_flicker_on_a_surface_that_moves_slowly():
    V, F = sheet(40)
    moving, _ = occlusion(V, F)

    def at(time):
        return moving(V + np.sin(3 * V[:, :1] + time) * [0, 0, 0.4])[:, 0]

    values = np.stack([at(0.01 * i) for i in range(8)])
    assert np.abs(np.diff(values, axis=0)).max() < 0.02
    assert rms(np.diff(values, 2, axis=0)) < 0.002


def test_two_sides_of_a_thin_plate_stay_apart():
    plate = shapes.ball(30)
    V = plate.shell * [1.0, 1.0, 0.02]
    normals = smooth_normals(V, plate.faces)
    moving, _ = occlusion(V, plate.faces)
    # a bowl: above it gets darker, below it does not
    moved = moving(V + (V[:, :1] ** 2 + V[:, 1:2] ** 2) * [0, 0, 0.8])[:, 0]
    middle = (np.hypot(V[:, 0], V[:, 1]) < 0.5) & (np.abs(normals[:, 2]) > 0.9)
    assert moved[middle & (V[:, 2] > 0)].max() < 0.93
    assert moved[middle & (V[:, 2] < 0)].min() > 0.97


def test_the_moving_occlusion_darkens_a_dent_in_the_frame(monkeypatch):
    model, data = posed(
        """<mujoco><worldbody><light pos="0 3 0" dir="0 -1 0"/>
        <geom name="target" type="sphere" size=".2"
        rgba=".2 .3 .5 1"/></worldbody></mujoco>"""
    )
    ripples = Ripples(model, {"target": Material(speed=1.0, density=1.0)}, resolution=8)
    ripples["target"].move(0.2 * dented(ripples["target"].rest.mesh.V / 0.2)[0])
    renderer = RippleRenderer(model, ripples, width=64, height=48, lighting="studio")
    camera = Camera(lookat=(0.0, 0.0, 0.0), distance=0.5, azimuth=90.0, elevation=-60.0)
    dark = renderer.render(data, camera).astype(float)
    monkeypatch.setattr(MovingOcclusion, "__call__", lambda self, V: self._baked.astype(np.float32))
    darker = (renderer.render(data, camera) - dark).mean(axis=2)
    assert darker.min() >= -1
    assert (darker > 1.5).sum() > 100


ATLAS = sphere_atlas(1.0, 8)
MATRIX = TURN.as_matrix()


def test_points_and_normals_follow_a_rigid_motion():
    points = ATLAS.positions.reshape(-1, 3)
    moving = MovingVertices(ATLAS.mesh.V, ATLAS.mesh.F, 1.01 * points, points, points)
    moved, directions, normals = moving(ATLAS.mesh.V @ MATRIX.T + [1, 2, 3])
    assert_allclose(moved, 1.01 * points @ MATRIX.T + [1, 2, 3], atol=1e-6)
    assert_allclose(normals, points @ MATRIX.T, atol=1e-6)
    assert_allclose(directions, points @ MATRIX.T, atol=1e-6)


def test_normals_stay_across_a_stretched_surface():
    points = ATLAS.positions.reshape(-1, 3)
    _, _, normals = MovingVertices(ATLAS.mesh.V, ATLAS.mesh.F, points, points, points)(
        ATLAS.mesh.V * [1, 1, 2]
    )
    exact = points / [1, 1, 2]
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    assert_allclose(normals, exact, atol=0.06)


def test_gradients_are_those_on_the_moved_surface():
    heights = (ATLAS.positions @ [0.1, 0.2, 0.3]).astype(np.float32)
    moved = MovedGradients(ATLAS)(HeightMap(ATLAS.texels)(heights), 2 * ATLAS.mesh.V @ MATRIX.T)
    still = HeightMap(ATLAS.texels)(heights)
    assert_allclose(moved[..., 3], still[..., 3])
    assert_allclose(moved[:, 1:-1, 1:-1, :3], still[:, 1:-1, 1:-1, :3] @ MATRIX.T / 2, atol=2e-3)


# a sphere of more than 32 is drawn with another mesh than its own
@pytest.mark.parametrize("resolution", [8, 40])
def test_a_frame_shows_the_surface_where_it_is(resolution):
    model, data = posed(
        """<mujoco><worldbody><light pos="0 0 3"/>
        <geom name="target" type="sphere" size=".2" rgba="1 0 0 1"/>
        </worldbody></mujoco>"""
    )
    ripples = Ripples(model, {"target": Material(speed=1.0, density=1.0)}, resolution=resolution)
    renderer = RippleRenderer(model, ripples, width=64, height=48)
    camera = Camera(lookat=(0.0, 0.0, 0.0), distance=1.5, azimuth=90.0, elevation=0.0)

    def middle() -> float:
        frame = renderer.render(data, camera).astype(int)
        return float(np.nonzero(frame[..., 0] > frame[..., 1] + 30)[0].mean())

    still = renderer.render(data, camera).astype(int)
    ripples["target"].move(ripples["target"].rest.mesh.V.copy())
    assert np.abs(renderer.render(data, camera) - still).mean() < 0.05
    before = middle()
    ripples["target"].move(ripples["target"].rest.mesh.V + np.array([0, 0, 0.2]))
    assert middle() < before - 4
