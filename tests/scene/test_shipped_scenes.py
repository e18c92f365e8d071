"""The shipped scenes: every target is hit, and its ripples are visible and not too high."""

import importlib.resources
import warnings
from typing import NamedTuple

import igl
import mujoco
import numpy as np
import pytest

from ripple_sim import Simulation, load_scene
from ripple_sim.scenes import shapes

SCENES = importlib.resources.files("ripple_sim.scenes")
NAMES = (
    "animal arm drum duck finger heavy jelly kick pair pretzel rolling skull sphere teapot terrain"
)


@pytest.mark.parametrize("name", NAMES.split())
def test_targets_are_hit_and_ripple_visibly(name: str) -> None:
    scene = load_scene(name)
    with warnings.catch_warnings(action="error"):
        simulation = Simulation(scene, fps=30, resolution=32, backend="cpu")
        hit = set()
        highest = dict.fromkeys(simulation.ripples, 0.0)
        end = min(scene.duration, 1.6)
        while simulation.data.time < end:
            simulation.advance_frame()
            if hit != set(highest):
                hit |= {impulse.geom for impulse in simulation.impulses}
                end = min(end, simulation.data.time + 0.6) if hit == set(highest) else end
            for target in highest:
                highest[target] = max(
                    highest[target], float(np.abs(simulation.ripples[target].height).max())
                )
    assert hit == set(highest)
    for target, height in highest.items():
        size = float(np.ptp(simulation.ripples[target].atlas.mesh.V, axis=0).max())
        assert 0.005 < height / size < 0.25
    assert scene.duration <= 5


def test_rolling_target_rolls_and_two_way_balls_hop() -> None:
    rolling = Simulation(load_scene("rolling"), fps=30, resolution=16, backend="cpu")
    kick = Simulation(load_scene("kick"), fps=30, resolution=48, backend="cpu")
    hop = 0.0
    for _ in range(45):
        rolling.advance_frame()
        kick.advance_frame()
        hop = max(hop, float(kick.data.body("ball_0").xpos[2]) - 0.29)
    assert np.linalg.norm(rolling.data.qvel[3:6]) > 2
    assert hop > 0.01


class FirstHit(NamedTuple):
    """Time of a toy's first hit [s], and its speed before [m/s]."""

    time: float
    speed: float


class Rain(NamedTuple):
    """Five seconds of the duck.

    Attributes
    ----------
    toys : list of int
        Ids of the geoms that drop.
    first_hits : dict
        Of each toy that hits the duck.
    inside : int
        How often a toy's middle was inside the duck.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    toys: list[int]
    first_hits: dict[int, FirstHit]
    inside: int


def load(name):
    model = mujoco.MjModel.from_xml_path(str(SCENES / f"{name}.xml"))
    return model, mujoco.MjData(model)


def pressing(model, data, target):
    """Geoms that press on the target now, each with its normal force [N]."""
    wrench = np.zeros(6)
    forces = {}
    for index, contact in enumerate(data.contact):
        if target in contact.geom and contact.efc_address >= 0:
            mujoco.mj_contactForce(model, data, index, wrench)
            other = int(contact.geom.sum()) - target
            forces[other] = forces.get(other, 0.0) + wrench[0]
    return {geom: force for geom, force in forces.items() if force > 0}


@pytest.fixture(scope="module")
def duck_rain() -> Rain:
    model, data = load("duck")
    V, F = shapes.duck()
    target = model.geom("duck").id
    toys = [g for g in range(model.ngeom) if model.geom(g).bodyid.item() > 0]
    first_hits: dict[int, FirstHit] = {}
    inside = 0
    for step in range(2500):
        velocity = data.qvel.reshape(-1, 6)[:, :3].copy()
        mujoco.mj_step(model, data)
        for geom in pressing(model, data, target):
            speed = np.linalg.norm(velocity[model.geom(geom).bodyid.item() - 1])
            first_hits.setdefault(geom, FirstHit(data.time, float(speed)))
        if step % 25 == 0:
            inside += int((igl.fast_winding_number(V, F, data.geom_xpos[toys]) > 0.5).sum())
    return Rain(model, data, toys, first_hits, inside)


def test_every_toy_hits_the_duck_and_the_hits_are_spread_over_time(duck_rain):
    assert len(duck_rain.toys) >= 10
    assert set(duck_rain.toys) == set(duck_rain.first_hits)
    times = np.sort([hit.time for hit in duck_rain.first_hits.values()])
    assert times[0] < 0.4
    assert 3.0 < times[-1] < 3.6
    assert np.diff(times).max() < 0.5


def test_no_toy_gets_into_the_duck_and_all_end_on_the_floor(duck_rain):
    assert duck_rain.inside == 0
    places = duck_rain.data.geom_xpos[duck_rain.toys]
    assert places[:, 2].max() < 0.15
    assert np.abs(places[:, :2]).max() < 1.6
    assert not any(warning.number for warning in duck_rain.data.warning)
    kinds = {int(duck_rain.model.geom_type[toy]) for toy in duck_rain.toys}
    assert len(kinds) == 5


def test_duck_stands_where_its_mesh_file_says():
    model, data = load("duck")
    mujoco.mj_kinematics(model, data)
    geom = model.geom("duck").id
    mesh = model.mesh("duck")
    start = mesh.vertadr.item()
    local = model.mesh_vert[start : start + mesh.vertnum.item()]
    world = local @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    V, _ = shapes.duck()
    np.testing.assert_allclose(np.sort(world, axis=0), np.sort(V, axis=0), atol=1e-5)
