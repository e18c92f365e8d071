"""Height fields: the triangles that MuJoCo collides, and waves on them."""

import mujoco
import numpy as np
import pytest
from mujoco_models import add_ball

from ripple_sim import Material, Ripples
from ripple_sim.coupling.target_mesh import height_field_triangles


def land(rows: int, columns: int) -> mujoco.MjSpec:
    heights = np.random.default_rng(4).uniform(0.3, 0.6, (rows, columns))
    heights[0, 0], heights[-1, -1] = 0.0, 1.0
    spec = mujoco.MjSpec()
    spec.option.timestep = 0.001
    spec.add_hfield(name="land", nrow=rows, ncol=columns, size=[1.2, 0.8, 0.3, 0.1], userdata=heights.ravel())
    spec.worldbody.add_geom(
        name="land", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="land", pos=[0.1, 0.2, 0.3], condim=1
    )
    return spec


def test_triangles_lie_where_mujocos_rays_meet_the_field_and_face_up() -> None:
    model = land(9, 12).compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    V, F = height_field_triangles(model, 0)
    rng = np.random.default_rng(0)
    for corners in V[F[rng.permutation(len(F))[:60]]] + model.geom_pos[0]:
        point = rng.dirichlet([1.0] * 3) @ corners
        above, down = point + np.array([0, 0, 5.0]), np.array([0, 0, -1.0])
        away = mujoco.mj_ray(model, data, above, down, None, 1, -1, np.zeros(1, np.int32))
        assert 5.0 - away == pytest.approx(0.0, abs=1e-6)
    assert (np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])[:, 2] > 0).all()


def test_a_ball_that_falls_on_land_gives_it_its_momentum() -> None:
    spec = land(9, 12)
    add_ball(spec, "ball", [0.3, 0.2, 1.0], condim=1)
    model = spec.compile()
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"land": Material(speed=1.0, density=20.0)}, resolution=16, conserve_volume=False)
    assert ripples["land"].atlas.layout == "patches"
    given, before = np.zeros(3), data.qvel[:3].copy()
    while data.time < 0.5:
        mujoco.mj_step(model, data)
        ripples.step(data)
        forces = np.zeros(6)
        for i in range(data.ncon):
            mujoco.mj_contactForce(model, data, i, forces)
            given += forces[0] * data.contact[i].frame[:3] * model.opt.timestep
    lost = 0.2 * (data.qvel[:3] - before - [0, 0, -9.81 * data.time])
    np.testing.assert_allclose(given, lost, rtol=0.01, atol=1e-3)
    assert ripples["land"].momentum() < -0.1
