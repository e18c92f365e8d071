"""The shipped MJCF models: the toys really hit the duck, one after the other, and never get into it."""

import importlib.resources

import igl
import mujoco
import numpy as np
import pytest

from ripple_sim.scenes import shapes

SCENES = importlib.resources.files("ripple_sim.scenes")


def load(name):
    model = mujoco.MjModel.from_xml_path(str(SCENES / f"{name}.xml"))
    return model, mujoco.MjData(model)


def pressing(model, data, target):
    """Geoms that press on the target now, each with its normal force [N]."""
    wrench, forces = np.zeros(6), {}
    for index, contact in enumerate(data.contact):
        if target in contact.geom and contact.efc_address >= 0:
            mujoco.mj_contactForce(model, data, index, wrench)
            other = int(contact.geom.sum()) - target
            forces[other] = forces.get(other, 0.0) + wrench[0]
    return {geom: force for geom, force in forces.items() if force > 0}


@pytest.fixture(scope="module")
def duck_rain():
    """Five seconds of the duck scene: time and speed of every toy's first hit, and how often one was inside."""
    model, data = load("duck")
    V, F = shapes.duck()
    target = model.geom("duck").id
    toys = [g for g in range(model.ngeom) if model.geom(g).bodyid.item() > 0]
    first, inside = {}, 0
    for step in range(2500):
        velocity = data.qvel.reshape(-1, 6)[:, :3].copy()
        mujoco.mj_step(model, data)
        for geom in pressing(model, data, target):
            speed = np.linalg.norm(velocity[model.geom(geom).bodyid.item() - 1])
            first.setdefault(geom, (data.time, speed))
        if step % 25 == 0:
            inside += int((igl.fast_winding_number(V, F, data.geom_xpos[toys]) > 0.5).sum())
    return model, data, toys, first, inside


def test_every_toy_hits_the_duck_and_the_hits_are_spread_over_time(duck_rain):
    model, _, toys, first, _ = duck_rain
    assert len(toys) >= 10
    assert {model.geom(g).name for g in toys} == {model.geom(g).name for g in first}
    times = np.sort([time for time, _ in first.values()])
    assert times[0] < 0.4
    assert 3.0 < times[-1] < 3.6
    assert np.diff(times).max() < 0.5


def test_toys_arrive_at_two_to_five_metres_a_second(duck_rain):
    *_, first, _ = duck_rain
    speeds = np.array([speed for _, speed in first.values()])
    assert speeds.min() > 2.0
    assert speeds.max() < 5.0


def test_no_toy_gets_into_the_duck_and_all_end_on_the_floor(duck_rain):
    model, data, toys, _, inside = duck_rain
    assert inside == 0
    assert data.geom_xpos[toys, 2].max() < 0.15
    assert np.abs(data.geom_xpos[toys, :2]).max() < 1.6
    assert not any(warning.number for warning in data.warning)
    assert len({int(model.geom_type[g]) for g in toys}) == 5


def test_duck_stands_where_its_mesh_file_says():
    model, data = load("duck")
    mujoco.mj_kinematics(model, data)
    geom, mesh = model.geom("duck").id, model.mesh("duck")
    start = mesh.vertadr.item()
    local = model.mesh_vert[start : start + mesh.vertnum.item()]
    world = local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    V, _ = shapes.duck()
    np.testing.assert_allclose(np.sort(world, axis=0), np.sort(V, axis=0), atol=1e-5)


def test_ball_bounces_on_the_sphere_with_restitution_of_about_a_half():
    model, data = load("sphere")
    target, touching, speeds = model.geom("sphere").id, False, []
    while data.time < 3.0:
        before = data.qvel[2]
        mujoco.mj_step(model, data)
        now = bool(pressing(model, data, target))
        if now != touching:
            speeds.append(before if now else data.qvel[2])
        touching = now
    assert speeds[0] < -2.0
    assert -speeds[1] / speeds[0] == pytest.approx(0.5, abs=0.1)
    assert data.qpos[2] == pytest.approx(0.07, abs=1e-3), "the ball did not roll off to the floor"


@pytest.mark.parametrize("name", ["duck", "sphere"])
def test_models_have_a_hero_camera_and_the_named_target(name):
    model, _ = load(name)
    assert model.camera("hero").id >= 0
    assert model.geom(name).bodyid.item() == 0
    assert all(model.geom(g).name for g in range(model.ngeom))
