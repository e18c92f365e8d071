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
MATRIX = TURN.as_matrix()
ATLAS = sphere_atlas(1.0, 8)

# columns of the light that is baked for a vertex; the second one is the thickness
OUTER = 0  # ambient visibility from the outer side
INNER = 2  # ambient visibility from the inner side
RAYS = 64  # from each vertex to either side


def occlusion(V, F):
    """The moving light at the vertices of a mesh, and the light that is baked at rest."""
    normals = smooth_normals(V, F)
    baked = bake(V, F, normals)
    return MovingOcclusion(V, F, V, normals, baked), baked


def light_from_scratch(V, F, radius):
    """Light of the vertices of a mesh as it is now, by rays."""
    return cast(V, F, frames_about(smooth_normals(V, F)), RAYS, radius)


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
    # coordinates 37 m from the origin are rounded more coarsely
    assert_allclose(moving(TURN.apply(V) + np.array([30.0, -20.0, 10.0])), baked, atol=2e-3)


@pytest.mark.parametrize("divisions", [10, 24])
def test_a_moving_dent_darkens_like_a_dent_in_the_mesh(divisions):
    ball = shapes.ball(divisions)
    moving, baked = occlusion(ball.shell, ball.faces)
    V, depth = dented(ball.shell)
    exact = light_from_scratch(V, ball.faces, radius=1.0)
    moved = moving(V)
    cavity = depth > 0.6
    flat_light = baked[cavity, OUTER].mean()
    exact_light = exact[cavity, OUTER].mean()
    moved_light = moved[cavity, OUTER].mean()
    assert exact_light < flat_light - 0.3
    # the moving mesh is coarse, and a narrow hole stays a little too light
    assert_allclose(moved_light, exact_light, atol=0.09)
    for column in range(3):
        error = rms(moved[:, column] - exact[:, column])
        change = rms(exact[:, column] - baked[:, column])
        assert error < 0.25 * change


@pytest.mark.parametrize("side", [1, -1])
def test_each_side_of_a_sheet_that_curls_has_its_own_light(side):
    """Most of a tube, whose inside sees a part of the sky and whose outside sees all of it."""
    V, F = sheet(40)
    moving, baked = occlusion(V, F)
    assert_allclose(baked[:, [OUTER, INNER]], 1.0)
    angle = 2.4 * V[:, 0]
    curled = np.stack([np.sin(angle), 2.4 * V[:, 1], side * (1 - np.cos(angle))], axis=1) / 2.4
    moved = moving(curled)
    exact = light_from_scratch(curled, F, bounding_radius(V))
    inside, outside = (OUTER, INNER) if side > 0 else (INNER, OUTER)
    middle = (np.abs(V[:, 0]) < 0.5) & (np.abs(V[:, 1]) < 0.5)
    assert moved[middle, inside].max() < 0.75
    assert_allclose(moved[middle, outside], 1.0, atol=0.01)  # one of 64 rays is 0.016
    assert rms(moved[:, inside] - exact[:, inside]) < 0.03  # two rays


def test_light_does_not_flicker_on_a_surface_that_moves_slowly():
    V, F = sheet(40)
    moving, _ = occlusion(V, F)

    def light_at(time):
        waves = np.sin(3 * V[:, :1] + time) * [0, 0, 0.4]
        return moving(V + waves)[:, OUTER]

    light = np.stack([light_at(0.01 * i) for i in range(8)])
    change = np.diff(light, axis=0)
    change_of_change = np.diff(light, 2, axis=0)
    assert np.abs(change).max() < 0.02  # about one of 64 rays
    assert rms(change_of_change) < 0.002


def test_two_sides_of_a_thin_plate_stay_apart():
    plate = shapes.ball(30)
    V = plate.shell * [1.0, 1.0, 0.02]
    normals = smooth_normals(V, plate.faces)
    moving, _ = occlusion(V, plate.faces)
    x, y, z = V.T
    bowl = V + (x**2 + y**2)[:, None] * [0, 0, 0.8]
    light = moving(bowl)[:, OUTER]
    middle = (np.hypot(x, y) < 0.5) & (np.abs(normals[:, 2]) > 0.9)
    # inside the bowl it gets darker, below the bowl it does not
    assert light[middle & (z > 0)].max() < 0.93
    assert light[middle & (z < 0)].min() > 0.97


def test_the_moving_occlusion_darkens_a_dent_in_the_frame(monkeypatch):
    model, data = posed(
        """<mujoco><worldbody><light pos="0 3 0" dir="0 -1 0"/>
        <geom name="target" type="sphere" size=".2"
        rgba=".2 .3 .5 1"/></worldbody></mujoco>"""
    )
    ripples = Ripples(model, {"target": Material(speed=1.0, density=1.0)}, resolution=8)
    target = ripples["target"]
    V, _ = dented(target.rest.mesh.V / 0.2)
    target.move(0.2 * V)
    renderer = RippleRenderer(model, ripples, width=64, height=48, lighting="studio")
    camera = Camera(lookat=(0.0, 0.0, 0.0), distance=0.5, azimuth=90.0, elevation=-60.0)
    moving = renderer.render(data, camera).astype(float)
    monkeypatch.setattr(MovingOcclusion, "__call__", lambda self, V: self._baked.astype(np.float32))
    at_rest = renderer.render(data, camera)
    darkening = (at_rest - moving).mean(axis=2)  # [codes of 255]
    assert darkening.min() >= -1  # round-off of a code
    assert (darkening > 1.5).sum() > 100


def test_points_and_normals_follow_a_rigid_motion():
    points = ATLAS.positions.reshape(-1, 3)
    moving = MovingVertices(ATLAS.mesh.V, ATLAS.mesh.F, 1.01 * points, points, points)
    moved, directions, normals = moving(ATLAS.mesh.V @ MATRIX.T + [1, 2, 3])
    assert_allclose(moved, 1.01 * points @ MATRIX.T + [1, 2, 3], atol=1e-6)
    assert_allclose(normals, points @ MATRIX.T, atol=1e-6)
    assert_allclose(directions, points @ MATRIX.T, atol=1e-6)


def test_normals_stay_across_a_stretched_surface():
    points = ATLAS.positions.reshape(-1, 3)
    moving = MovingVertices(ATLAS.mesh.V, ATLAS.mesh.F, points, points, points)
    _, _, normals = moving(ATLAS.mesh.V * [1, 1, 2])
    exact = points / [1, 1, 2]
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    assert_allclose(normals, exact, atol=0.06)  # the sphere has facets


def test_gradients_are_those_on_the_moved_surface():
    """On a sphere that is turned and twice as large, gradients turn along and are half as large."""
    heights = (ATLAS.positions @ [0.1, 0.2, 0.3]).astype(np.float32)
    still = HeightMap(ATLAS.texels)(heights)
    moved = MovedGradients(ATLAS)(HeightMap(ATLAS.texels)(heights), 2 * ATLAS.mesh.V @ MATRIX.T)
    height = 3  # the last channel; the others are the gradient
    assert_allclose(moved[..., height], still[..., height])
    gradients = still[:, 1:-1, 1:-1, :height]  # without the halo
    # the moved gradients are those on the facets
    assert_allclose(moved[:, 1:-1, 1:-1, :height], gradients @ MATRIX.T / 2, atol=2e-3)


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

    target = ripples["target"]

    def middle_row() -> float:
        """Mean row of the red pixels."""
        frame = renderer.render(data, camera).astype(int)
        red, green, _ = np.moveaxis(frame, -1, 0)
        rows, _ = np.nonzero(red > green + 30)
        return float(rows.mean())

    still = renderer.render(data, camera).astype(int)
    target.move(target.rest.mesh.V.copy())
    # the mesh of a moving surface differs by round-off
    assert np.abs(renderer.render(data, camera) - still).mean() < 0.05
    before = middle_row()
    target.move(target.rest.mesh.V + np.array([0, 0, 0.2]))
    assert middle_row() < before - 4
