"""From contacts to impulses: the right place and amount, on still and moving targets."""

from pathlib import Path

import gymnasium
import igl
import mujoco
import numpy as np
import pytest
from hits import Run, contact_forces
from mujoco_models import BALL, forwarded, limbed_asset, model_of

from ripple_sim import Material, Ripples


def impulses(model: mujoco.MjModel, geom: str, seconds: float, **options):
    """Run; return the ripples, and every impulse with the middle of the ball at that moment."""
    run = Run(
        model, geom, material=Material(speed=0.5, density=50.0), conserve_volume=True, **options
    )
    record = []
    while run.data.time < seconds:
        hits = run.step()
        record += [(hit, run.data.body("ball").xpos.copy()) for hit in hits]
    return run.ripples, record


@pytest.mark.parametrize(
    ("transform", "placing"),
    [
        ("", ""),
        ('refpos="0.3 -0.2 0.1"', ""),
        ('refquat="0.9 0.1 -0.3 0.2" scale="1.5 1.5 1.5"', ""),
        ('scale="0.8 0.8 0.8"', 'pos="0.4 0.1 0.2" euler="20 -30 70"'),
    ],
)
def test_ball_on_a_concave_mesh_hits_the_surface_under_it(transform: str, placing: str) -> None:
    geom = f'<geom name="target" type="sdf" mesh="limbed" {placing}/>'
    asset = limbed_asset(transform)
    probe = model_of(geom + BALL.format("0 0 99"), asset)
    data = forwarded(probe)
    ripples = Ripples(probe, {"target": Material()}, resolution=64, backend="cpu")
    mesh = ripples["target"].atlas.mesh
    world = ripples["target"].to_world(mesh.V, data)
    # a place on the saddle between shoulder and hip: inside the convex hull
    middle = world.mean(axis=0)
    near = world[np.linalg.norm(world[:, :2] - middle[:2], axis=1) < 0.03]
    top = near[near[:, 2].argmax()]
    model = model_of(geom + BALL.format(f"{top[0]} {top[1]} {top[2] + 0.15}"), asset)
    ripples, record = impulses(model, "target", 0.4, resolution=64)
    assert record
    waves = ripples["target"]  # the target stands still
    atlas = waves.atlas
    for impulse, ball in record[:3]:
        local = waves.from_world(impulse.point)
        # on the true surface ...
        closest, _ = atlas.project(local)
        assert np.linalg.norm(closest[0] - local) < 1e-9
        # ... where it is nearest to the ball's middle, which is where a ball touches
        touching, _ = atlas.project(waves.from_world(ball))
        texel = impulse.texel
        assert np.linalg.norm(atlas.positions[texel] - touching[0]) < np.sqrt(atlas.areas[texel])
        assert np.linalg.norm(impulse.point - ball) == pytest.approx(0.05, abs=0.012)


def test_sources_lie_where_mujocos_contacts_do_on_tumbling_concave_targets() -> None:
    """The contacts' mean point by force, and the nearest point of the mesh, without the atlas."""
    target = (
        '<body name="target"><freejoint/><geom name="target" type="sdf" mesh="limbed" '
        'mass="20"/></body>'
    )
    model = model_of(target + BALL.format("3 0 0"), limbed_asset(), 'gravity="0 0 0"')
    run = Run(model, "target", material=Material(), resolution=128, conserve_volume=True)
    off = []
    data = run.data
    rng = np.random.default_rng(7)
    atlas = run.ripples["target"].atlas
    for _ in range(14):
        mujoco.mj_resetData(model, data)
        data.qpos[3:7] = (quat := rng.standard_normal(4)) / np.linalg.norm(quat)
        data.qvel[:6] = rng.uniform(-1, 1, 6) * [0.3, 0.3, 0.3, 2, 2, 2]
        mujoco.mj_kinematics(model, data)
        pose = data.geom("target").xmat.reshape(3, 3), data.geom("target").xpos
        aim = pose[0] @ rng.choice(atlas.mesh.V) + pose[1]
        way = rng.standard_normal(3)
        way /= np.linalg.norm(way)
        data.qpos[7:10] = aim - 0.9 * way
        data.qvel[6:9] = 3.0 * way
        hits = 0
        while data.time < 0.5 and hits < 4:
            for impulse in run.step():
                hits += 1
                forces = np.maximum(contact_forces(model, data)[:, 0], 0.0)
                world = run.ripples["target"].to_world(atlas.mesh.V)
                weighted = forces @ data.contact.pos / forces.sum()
                _, _, nearest = igl.point_mesh_squared_distance(weighted[None], world, atlas.mesh.F)
                texel = np.sqrt(atlas.areas[impulse.texel])
                off.append(np.linalg.norm(nearest[0] - impulse.point) / texel)
    assert len(off) > 30
    assert np.quantile(off, 0.99) < 0.5


def test_second_step_at_the_same_time_does_nothing() -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 0.549"))
    run = Run(model, "target", material=Material(), resolution=8, conserve_volume=True).until(0.003)
    ripples = run.ripples
    waves = run.ripples["target"]
    assert ripples.last_impulses
    height = waves.height
    velocity = waves.velocity
    ripples.step(run.data)
    assert not ripples.last_impulses
    np.testing.assert_array_equal(waves.height, height)
    np.testing.assert_array_equal(waves.velocity, velocity)
    assert waves.time == pytest.approx(run.data.time)


@pytest.mark.filterwarnings("ignore:MuJoCo. compiler attribute 'settotalmass'")
def test_seat_of_gymnasiums_humanoid_that_falls_on_its_back_ripples() -> None:
    """A model as users write it, in a loop with three more lines."""
    model = mujoco.MjModel.from_xml_path(
        str(Path(gymnasium.__file__).parent / "envs/mujoco/assets/humanoid.xml")
    )
    # (1)
    ripples = Ripples(
        model, {"butt": Material(speed=0.3, density=30.0)}, resolution=24, backend="cpu"
    )
    ends = []
    given = 0.0
    for rippling in (True, False):
        data = mujoco.MjData(model)
        data.qpos[2:7] = 0.5, 0.7, 0.0, 0.7, 0.0
        while data.time < 0.6:
            mujoco.mj_step(model, data)
            if rippling:
                ripples.step(data)  # (2)
                given += sum(hit.impulse for hit in ripples.last_impulses if hit.other == "floor")
        assert not any(warning.number for warning in data.warning)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(*ends)
    assert 0.01 < given / (sum(model.body_mass) * 9.81) < 10
    assert np.abs(ripples["butt"].height).max() > 1e-4
