"""From contacts to impulses: the right place, the right amount, on still and moving targets of every kind."""

import igl
import mujoco
import numpy as np
import pytest
from mujoco_models import BALL, limbed_asset, model_of

from ripple_sim import Material, Ripples

GRAVITY = 9.81


def impulses(model: mujoco.MjModel, geom: str, seconds: float, **options):
    """Run; return the ripples, the data, and every impulse with the data's pose of the target at that moment."""
    data = mujoco.MjData(model)
    ripples = Ripples(model, {geom: Material(speed=0.5, density=50.0)}, backend="cpu", **options)
    record = []
    while data.time < seconds:
        mujoco.mj_step(model, data)
        ripples.step(data)
        pose = data.geom(geom).xpos.copy(), data.geom(geom).xmat.reshape(3, 3).copy()
        record += [(impulse, pose, data.body("ball").xpos.copy()) for impulse in ripples.last_impulses]
    return ripples, data, record


def texels_apart(ripples: Ripples, geom: str, texel: tuple[int, int, int], point: np.ndarray) -> float:
    """Distance from a texel to a point of the target's frame, in widths of that texel."""
    atlas = ripples[geom].atlas
    face, row, column = texel
    center = atlas.positions[texel]
    block = atlas.padded_positions[face, row : row + 3, column : column + 3]
    width = np.nanmax(np.linalg.norm(block - center, axis=-1))
    return float(np.linalg.norm(center - point) / width)


def test_ball_on_a_sphere_hits_the_texel_under_it() -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0.12 -0.07 0.7"))
    ripples, _, record = impulses(model, "target", 0.3, resolution=64)
    impulse, _, _ = record[0]
    # the surface point below the middle of a ball that touches a sphere lies on the line between the middles
    expected = np.array([0.12, -0.07, 0.0])
    expected[2] = np.sqrt((0.5 + 0.05) ** 2 - expected[0] ** 2 - expected[1] ** 2)
    expected *= 0.5 / 0.55
    assert np.linalg.norm(impulse.point) == pytest.approx(0.5, rel=1e-6)
    assert texels_apart(ripples, "target", impulse.texel, expected) < 1
    assert (impulse.geom, impulse.other) == ("target", "ball")


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
    data = mujoco.MjData(probe)
    mujoco.mj_forward(probe, data)
    ripples = Ripples(probe, {"target": Material()}, resolution=64, backend="cpu")
    mesh = ripples["target"].atlas.mesh
    world = mesh.V @ data.geom("target").xmat.reshape(3, 3).T + data.geom("target").xpos
    # a place on the saddle between shoulder and hip: inside the convex hull
    middle = world.mean(axis=0)
    near = world[np.linalg.norm(world[:, :2] - middle[:2], axis=1) < 0.03]
    top = near[near[:, 2].argmax()]
    model = model_of(geom + BALL.format(f"{top[0]} {top[1]} {top[2] + 0.15}"), asset)
    ripples, _, record = impulses(model, "target", 0.4, resolution=64)
    assert record
    for impulse, (position, rotation), ball in record[:3]:
        local = (impulse.point - position) @ rotation
        # on the true surface ...
        closest, _ = ripples["target"].atlas.project(local)
        assert np.linalg.norm(closest[0] - local) < 1e-9
        # ... where it is nearest to the ball's middle, which is where a ball touches
        touching, _ = ripples["target"].atlas.project((ball - position) @ rotation)
        assert texels_apart(ripples, "target", impulse.texel, touching[0]) < 1
        assert np.linalg.norm(impulse.point - ball) == pytest.approx(0.05, abs=0.012)


def test_impulse_follows_a_moving_target() -> None:
    target = """<body name="target" pos="0 0 0.3" euler="0 0 30"><freejoint/>
        <geom name="target" type="sdf" mesh="limbed" mass="5"/></body>"""
    model = model_of(target + BALL.format("0.05 0.02 1.0"), limbed_asset(), 'gravity="0 0 0"')
    data = mujoco.MjData(model)
    data.qvel[:6] = [0.4, -0.2, 0.3, 0.5, 1.0, -2.0]
    data.qvel[6:9] = [0.4, -0.2, -2.5]
    ripples = Ripples(model, {"target": Material(density=50.0)}, resolution=64, backend="cpu")
    found = 0
    while data.time < 0.6 and found < 3:
        before = data.body("ball").xpos.copy()
        mujoco.mj_step(model, data)
        ripples.step(data)
        for impulse in ripples.last_impulses:
            found += 1
            position, rotation = data.geom("target").xpos, data.geom("target").xmat.reshape(3, 3)
            # poses in data after a step are those at its beginning, which the contacts belong to
            touching, _ = ripples["target"].atlas.project((data.geom("ball").xpos - position) @ rotation)
            local = (impulse.point - position) @ rotation
            assert texels_apart(ripples, "target", impulse.texel, local) < 1
            # MuJoCo's contacts with a signed distance scatter by some millimetres
            assert np.linalg.norm(local - touching[0]) < 0.01
            assert np.linalg.norm(impulse.point - before) < 0.08
    assert found == 3


def test_sources_lie_where_mujocos_contacts_do_on_tumbling_concave_targets() -> None:
    """Independent of the atlas: the contacts' force-weighted point, and the nearest point of the mesh in the world."""
    target = '<body name="target"><freejoint/><geom name="target" type="sdf" mesh="limbed" mass="20"/></body>'
    model = model_of(target + BALL.format("3 0 0"), limbed_asset(), 'gravity="0 0 0"')
    data, rng, wrench = mujoco.MjData(model), np.random.default_rng(7), np.zeros(6)
    ripples = Ripples(model, {"target": Material()}, resolution=128, backend="cpu")
    atlas = ripples["target"].atlas
    off = []
    for _ in range(14):
        mujoco.mj_resetData(model, data)
        data.qpos[3:7] = (quat := rng.standard_normal(4)) / np.linalg.norm(quat)
        data.qvel[:6] = rng.uniform(-1, 1, 6) * [0.3, 0.3, 0.3, 2, 2, 2]
        mujoco.mj_kinematics(model, data)
        pose = data.geom("target").xmat.reshape(3, 3), data.geom("target").xpos
        aim, way = pose[0] @ rng.choice(atlas.mesh.V) + pose[1], rng.standard_normal(3)
        way /= np.linalg.norm(way)
        data.qpos[7:10], data.qvel[6:9] = aim - 0.9 * way, 3.0 * way
        hits = 0
        while data.time < 0.5 and hits < 4:
            mujoco.mj_step(model, data)
            ripples.step(data)
            for impulse in ripples.last_impulses:
                hits += 1
                points, forces = [], []
                for i, contact in enumerate(data.contact):
                    mujoco.mj_contactForce(model, data, i, wrench)
                    points.append(contact.pos.copy())
                    forces.append(max(wrench[0], 0.0))
                world = atlas.mesh.V @ data.geom("target").xmat.reshape(3, 3).T + data.geom("target").xpos
                weighted = np.array(forces) @ np.array(points) / sum(forces)
                _, _, nearest = igl.point_mesh_squared_distance(weighted[None], world, atlas.mesh.F)
                texel = np.sqrt(atlas.areas[impulse.texel])
                off.append(np.linalg.norm(nearest[0] - impulse.point) / texel)
    assert len(off) > 30
    assert np.quantile(off, 0.99) < 0.5


@pytest.mark.parametrize("kind", ["sphere", "mesh"])
def test_sum_of_impulses_is_the_bodys_change_of_momentum(kind: str) -> None:
    if kind == "sphere":
        model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 0.75"))
    else:
        model = model_of('<geom name="target" type="sdf" mesh="limbed"/>' + BALL.format("-0.05 0 0.65"), limbed_asset())
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"target": Material(density=50.0)}, resolution=48, backend="cpu", conserve_volume=False)
    given, change, gravity = 0.0, np.zeros(3), np.array([0, 0, -GRAVITY])
    touched = False
    while data.time < 0.6:
        velocity = data.qvel[:3].copy()
        mujoco.mj_step(model, data)
        ripples.step(data)
        if ripples.last_impulses:
            touched = True
            given += sum(impulse.impulse for impulse in ripples.last_impulses)
            change += 0.3 * (data.qvel[:3] - velocity - gravity * model.opt.timestep)
        elif touched:
            break
    assert given == pytest.approx(np.linalg.norm(change), rel=0.05)
    # and the surface has taken it up, to round-off
    assert ripples["target"].momentum() == pytest.approx(-given, rel=1e-5)


def test_contact_pairs_hold_for_either_order_of_geoms() -> None:
    # MuJoCo orders the geoms of a contact by type, not by the order in the file
    for worldbody in (
        '<geom name="target" type="box" size="0.3 0.3 0.1"/>' + BALL.format("0.1 0.1 0.16"),
        BALL.format("0.1 0.1 0.16") + '<geom name="target" type="box" size="0.3 0.3 0.1"/>',
        '<geom name="target" type="capsule" size="0.2 0.1"/>'
        '<body name="ball" pos="0 0 0.32"><freejoint/><geom name="ball" type="box" size=".03 .03 .03"/></body>',
    ):
        _, _, record = impulses(model_of(worldbody), "target", 0.2, resolution=24)
        assert record
        assert all(impulse.impulse >= 0 for impulse, _, _ in record)
        assert sum(impulse.impulse for impulse, _, _ in record) > 0


def test_two_targets_that_touch_both_ripple() -> None:
    model = model_of(
        """<geom name="low" type="sphere" size="0.3"/>
        <body name="ball" pos="0 0 0.52"><freejoint/><geom name="high" type="sphere" size="0.2" mass="1"/></body>"""
    )
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"low": Material(), "high": Material()}, resolution=24, backend="cpu")
    while data.time < 0.2:
        mujoco.mj_step(model, data)
        ripples.step(data)
        if ripples.last_impulses:
            break
    low, high = ripples.last_impulses
    assert (low.geom, low.other, high.geom, high.other) == ("low", "high", "high", "low")
    assert low.impulse == high.impulse
    assert low.point[2] > 0.29
    assert high.point[2] < 0.33
    assert all(ripples[name].height.any() for name in ripples)


def test_reset_of_the_simulation_resets_the_waves() -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 0.6"))
    ripples, data, record = impulses(model, "target", 0.2, resolution=16)
    assert record
    mujoco.mj_resetData(model, data)
    mujoco.mj_step(model, data)
    ripples.step(data)
    assert not ripples["target"].height.any()
    assert ripples["target"].time == pytest.approx(model.opt.timestep)


def test_waves_keep_pace_with_the_clock() -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 2"))
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"target": Material()}, resolution=8, backend="cpu")
    for _ in range(7):
        mujoco.mj_step(model, data)
        ripples.step(data)
    assert ripples["target"].time == pytest.approx(data.time)


def test_second_step_at_the_same_time_does_nothing() -> None:
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0 0 0.549"))
    data = mujoco.MjData(model)
    ripples = Ripples(model, {"target": Material()}, resolution=8, backend="cpu")
    for _ in range(3):
        mujoco.mj_step(model, data)
        ripples.step(data)
    assert ripples.last_impulses
    height, velocity = ripples["target"].height, ripples["target"].velocity
    ripples.step(data)
    assert not ripples.last_impulses
    np.testing.assert_array_equal(ripples["target"].height, height)
    np.testing.assert_array_equal(ripples["target"].velocity, velocity)
    assert ripples["target"].time == pytest.approx(data.time)


def test_the_same_scene_gives_the_same_bits() -> None:
    heights = []
    for _ in range(2):
        model = model_of('<geom name="target" type="sdf" mesh="limbed"/>' + BALL.format("-0.05 0 0.65"), limbed_asset())
        ripples, _, record = impulses(model, "target", 0.4, resolution=32)
        assert record
        heights.append(ripples["target"].height)
    np.testing.assert_array_equal(heights[0], heights[1])
