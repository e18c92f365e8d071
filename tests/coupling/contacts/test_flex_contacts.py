"""Contacts with flex colliders: the right place, the right amount, under the right name."""

import warnings

import mujoco
import numpy as np
import pytest
from mujoco_models import add_ball, mesh_spec

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.errors import RippleWarning
from ripple_sim.scenes.shapes import limbed, peanut

GEOM = mujoco.mjtGeom


def run(spec: mujoco.MjSpec, targets: list[str], seconds: float) -> tuple[Ripples, list, mujoco.MjData]:
    model = spec.compile()
    data = mujoco.MjData(model)
    material = {name: Material(density=50) for name in targets}
    ripples, impulses = Ripples(model, material, resolution=12, backend="cpu", conserve_volume=False), []
    while data.time < seconds:
        mujoco.mj_step(model, data)
        ripples.step(data)
        impulses += ripples.last_impulses
    return ripples, impulses, data


ROUND = {
    "sphere": {"size": [0.05, 0, 0]},
    "capsule": {"type": GEOM.mjGEOM_CAPSULE, "size": [0.03, 0.05, 0]},
    "ellipsoid": {"type": GEOM.mjGEOM_ELLIPSOID, "size": [0.07, 0.06, 0.04]},
    "cylinder": {"type": GEOM.mjGEOM_CYLINDER, "size": [0.05, 0.03, 0]},
    "mesh": {"type": GEOM.mjGEOM_MESH, "meshname": "pebble"},
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("body", ROUND)
def test_bodies_in_any_pose_give_what_they_lose_on_their_side(body: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    spec = mesh_spec(limbed(0.04), "free" if seed % 2 else None, condim=1)
    V, F = peanut(0.06)
    pebble = 0.05 * V / np.linalg.norm(V, axis=1, keepdims=True)
    spec.add_mesh(name="pebble", uservert=pebble.ravel(), userface=F.ravel())
    spec.option.gravity = [0, 0, 0]
    add_ball(spec, "body", [0, 0, 9], condim=1, **ROUND[body])
    model = spec.compile()
    data, joint = mujoco.MjData(model), model.joint(model.body("body").jntadr[0])
    mujoco.mj_forward(model, data)
    way, place, start = rng.standard_normal(3), joint.qposadr[0], joint.dofadr[0]
    way /= np.linalg.norm(way)
    data.qpos[place : place + 7] = [*(data.geom("target").xpos + 0.6 * way), *rng.standard_normal(4)]
    data.qvel[start : start + 6] = [*(-2 * way + rng.uniform(-0.1, 0.1, 3)), *rng.uniform(-3, 3, 3)]
    ripples = Ripples(model, {"target": Material(density=50)}, resolution=12, backend="cpu", conserve_volume=False)
    atlas, given, lost = ripples["target"].atlas, 0.0, 0.0
    while data.time < 0.5:
        before = data.qvel[start : start + 3].copy()
        mujoco.mj_step(model, data)
        ripples.step(data)
        change = 0.2 * (data.qvel[start : start + 3] - before)
        lost += float(np.linalg.norm(change))
        for impulse in ripples.last_impulses:
            given += impulse.impulse
            assert data.geom("target").xmat.reshape(3, 3) @ atlas.normals[impulse.texel] @ change > 0
    assert given > 0.1
    assert given == pytest.approx(lost, rel=0.03)
    assert -ripples["target"].momentum() == pytest.approx(given, rel=0.03)


def test_impulses_lie_where_the_balls_are_nearest_to_the_true_surface() -> None:
    spec = mesh_spec(peanut(0.03))
    spec.option.gravity = [0, 0, 0]
    rng = np.random.default_rng(0)
    # one side collides with the other alone: the balls pass through each other
    spec.flex("target").contype, spec.flex("target").conaffinity = 2, 0
    directions = rng.standard_normal((30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for i, direction in enumerate(directions):
        start = np.array([0.1, -0.2, 0.3]) + 0.5 * direction + rng.uniform(-0.03, 0.03, 3)
        add_ball(spec, f"ball {i}", start.tolist(), size=[0.02, 0, 0], contype=0, conaffinity=2, solref=[0.01, 1.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel.reshape(-1, 6)[:, :3] = -directions
    ripples = Ripples(model, {"target": Material()}, resolution=48, backend="cpu")
    atlas, off, hit = ripples["target"].atlas, [], set()
    while data.time < 0.6:
        mujoco.mj_step(model, data)
        ripples.step(data)
        position, rotation = data.geom("target").xpos, data.geom("target").xmat.reshape(3, 3)
        for impulse in ripples.last_impulses:
            nearest, _ = atlas.project((data.geom(impulse.other).xpos - position) @ rotation)
            off.append(np.linalg.norm((impulse.point - position) @ rotation - nearest))
            hit.add(impulse.other)
    assert len(hit) == len(directions)
    texel = np.sqrt(atlas.areas.mean())
    assert np.median(off) < 0.3 * texel
    assert np.quantile(off, 0.99) < texel


def test_two_targets_with_flexes_ripple_with_one_momentum() -> None:
    V, F = peanut(0.05)
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    for name, height in (("lower", 0.0), ("upper", 0.45)):
        body = spec.worldbody.add_body(name=name, pos=[0.01, 0.02, height])
        joint = body.add_freejoint()
        joint.name = name
        body.add_geom(name=name, type=GEOM.mjGEOM_MESH, meshname="shape", mass=2.0)
        make_collidable(spec, name, "flex")
    model = spec.compile()
    data = mujoco.MjData(model)
    data.joint("upper").qvel[2] = -1.5
    ripples = Ripples(
        model, {"lower": Material(), "upper": Material()}, resolution=12, backend="cpu", conserve_volume=False
    )
    given = {"lower": 0.0, "upper": 0.0}
    while data.time < 0.3:
        mujoco.mj_step(model, data)
        ripples.step(data)
        for impulse in ripples.last_impulses:
            given[impulse.geom] += impulse.impulse
            assert {impulse.geom, impulse.other} == {"lower", "upper"}
    lost = 2.0 * np.linalg.norm(data.joint("upper").qvel[:3] - [0, 0, -1.5])
    assert given["lower"] == pytest.approx(lost, rel=0.03)
    assert given["upper"] == pytest.approx(lost, rel=0.03)


@pytest.mark.parametrize("ripples_too", [True, False])
def test_what_hits_a_flex_and_ripples_itself_gets_as_much_as_it_loses(ripples_too: bool) -> None:
    spec = mesh_spec(limbed(0.04), condim=1)
    spec.option.gravity = [0, 0, 0]
    add_ball(spec, "body", [0, 0, 9], condim=1, **ROUND["cylinder"])
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    data.qpos[:3] = data.geom("target").xpos + np.array([0, 0, 0.6])
    data.qpos[3:7] = np.random.default_rng(2).standard_normal(4)
    data.qvel[2:6] = -2.0, 3.0, 2.0, 1.0
    materials = {name: Material(density=50) for name in (["target"] if ripples_too else []) + ["body"]}
    ripples, given = Ripples(model, materials, resolution=12, backend="cpu", conserve_volume=False), {}
    lost, mass = 0.0, model.body("body").mass[0]
    for _ in range(150):
        before = data.qvel[:3].copy()
        ripples.mj_step(data)
        lost += mass * np.linalg.norm(data.qvel[:3] - before)
        for hit in ripples.last_impulses:
            given[hit.geom] = given.get(hit.geom, 0.0) + hit.impulse
    assert lost > 0.2
    assert given.keys() == materials.keys()
    for impulse in given.values():
        assert impulse == pytest.approx(lost, rel=1e-3)


def test_flex_of_a_geom_that_does_not_ripple_goes_by_the_geoms_name() -> None:
    spec = mujoco.MjSpec()
    V, F = peanut(0.05)
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    spec.default.geom.condim = 1
    spec.worldbody.add_geom(name="ball", size=[0.3, 0, 0])
    body = spec.worldbody.add_body(name="animal", pos=[0, 0, 0.7])
    body.add_freejoint()
    body.add_geom(name="animal", type=GEOM.mjGEOM_MESH, meshname="shape", mass=0.5)
    make_collidable(spec, "animal", "flex")
    _, impulses, data = run(spec, ["ball"], 0.4)
    assert {(impulse.geom, impulse.other) for impulse in impulses} == {("ball", "animal")}
    lost = 0.5 * (data.body("animal").cvel[5] + 9.81 * data.time)
    assert sum(impulse.impulse for impulse in impulses) == pytest.approx(lost, rel=0.1)


def test_flex_written_by_hand_is_known_by_its_name() -> None:
    V, F = peanut(0.05)
    points, triangles = " ".join(f"{x:.5g}" for x in V.ravel()), " ".join(map(str, F.ravel()))
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><asset><mesh name="shape" vertex="{points}" face="{triangles}"/></asset><worldbody>
        <geom name="target" type="mesh" mesh="shape" contype="0" conaffinity="0"/>
        <flexcomp name="target" type="direct" dim="2" rigid="true" radius="0.004" point="{points}"
        element="{triangles}"/></worldbody></mujoco>"""
    )
    add_ball(spec, "ball", [-0.17, 0.01, 0.35])
    ripples, impulses, data = run(spec, ["target"], 0.25)
    assert {(impulse.geom, impulse.other) for impulse in impulses} == {("target", "ball")}
    lost = 0.2 * np.linalg.norm(data.body("ball").cvel[3:] + np.array([0, 0, 9.81]) * data.time)
    assert sum(impulse.impulse for impulse in impulses) == pytest.approx(lost, rel=0.03)
    assert -ripples["target"].momentum() == pytest.approx(lost, rel=0.05)


def cylinder_on_flex(speed: float) -> tuple[list[str], float, float]:
    """Warnings of pushes sideways, impulses, and the momentum that a cylinder lost."""
    spec = mesh_spec(limbed(0.04), condim=1)
    spec.option.gravity, spec.option.timestep = [0, 0, 0], 0.002
    add_ball(spec, "body", [0.1, -0.2, 1.4], condim=1, type=GEOM.mjGEOM_CYLINDER, size=[0.05, 0.03, 0])
    model = spec.compile()
    data, given, lost = mujoco.MjData(model), 0.0, 0.0
    mujoco.mj_forward(model, data)
    data.qpos[:3], data.qvel[:3] = data.geom("target").xpos, [0, 0, -speed]
    data.qpos[2] += 0.8
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RippleWarning)
        ripples = Ripples(model, {"target": Material(density=50)}, resolution=12, backend="cpu")
        while data.time < 1.5 / speed:
            before = data.qvel[:3].copy()
            mujoco.mj_step(model, data)
            ripples.step(data)
            given += sum(impulse.impulse for impulse in ripples.last_impulses)
            lost += 0.2 * np.linalg.norm(data.qvel[:3] - before)
    return [str(each.message) for each in caught if "sideways" in str(each.message)], given, lost


def test_what_sinks_into_a_flex_and_is_pushed_sideways_is_warned_of() -> None:
    messages, given, lost = cylinder_on_flex(4.0)
    assert given == pytest.approx(lost, rel=1e-3)
    assert not messages
    messages, given, lost = cylinder_on_flex(30.0)
    assert abs(given - lost) > 0.05 * lost
    assert len(messages) == 1
    assert "the impulses on geom 'target' are wrong by about" in messages[0]
