"""Points, normals and gradients that go along with a mesh whose vertices move."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from ripple_sim import Camera, RippleRenderer, Ripples
from ripple_sim.render.surfaces.moving import MovingVertices
from ripple_sim.solver import HeightMap, Material, sphere_atlas
from ripple_sim.solver.waves.motion import MovedGradients

ATLAS = sphere_atlas(1.0, 8)
TURN = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
TURN *= np.sign(np.linalg.det(TURN))


def test_a_rigid_motion_takes_points_and_normals_along():
    points = ATLAS.positions.reshape(-1, 3)
    moving = MovingVertices(ATLAS.mesh.V, ATLAS.mesh.F, 1.01 * points, points, points)
    moved, directions, normals = moving(ATLAS.mesh.V @ TURN.T + [1, 2, 3])
    assert_allclose(moved, 1.01 * points @ TURN.T + [1, 2, 3], atol=1e-6)
    assert_allclose(normals, points @ TURN.T, atol=1e-6)
    assert_allclose(directions, points @ TURN.T, atol=1e-6)


def test_normals_stay_across_a_stretched_surface():
    points = ATLAS.positions.reshape(-1, 3)
    _, _, normals = MovingVertices(ATLAS.mesh.V, ATLAS.mesh.F, points, points, points)(ATLAS.mesh.V * [1, 1, 2])
    exact = points / [1, 1, 2]
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    assert_allclose(normals, exact, atol=0.06)


def test_gradients_are_those_on_the_moved_surface():
    heights = (ATLAS.positions @ [0.1, 0.2, 0.3]).astype(np.float32)
    moved = MovedGradients(ATLAS)(HeightMap(ATLAS.texels)(heights), 2 * ATLAS.mesh.V @ TURN.T)
    still = HeightMap(ATLAS.texels)(heights)
    assert_allclose(moved[..., 3], still[..., 3])
    assert_allclose(moved[:, 1:-1, 1:-1, :3], still[:, 1:-1, 1:-1, :3] @ TURN.T / 2, atol=2e-3)


@pytest.mark.parametrize("resolution", [8, 40])  # a sphere of more than 32 is drawn with another mesh than its own
def test_a_frame_shows_the_surface_where_it_is(resolution):
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><light pos="0 0 3"/><geom name="target" type="sphere" size=".2" rgba="1 0 0 1"/>
        </worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
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
