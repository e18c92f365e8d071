"""Contacts with flex colliders: place, name, and the sum of forces along the mean normal."""

import warnings
from types import SimpleNamespace
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
import trimesh
from hits import Run
from mujoco_models import add_ball, mesh_asset, mesh_spec, vector

from ripple_sim import RippleWarning, make_collidable
from ripple_sim.coupling import ContactReader, CoupledModel, FlexContacts, target_atlas
from ripple_sim.coupling.target_mesh import target_mesh
from ripple_sim.scenes.shapes import limbed, peanut

GEOM = mujoco.mjtGeom
BALL_MASS = 0.2  # kg, of the bodies that `add_ball` adds
ROUND = {
    "sphere": {"size": [0.05, 0, 0]},
    "capsule": {"type": GEOM.mjGEOM_CAPSULE, "size": [0.03, 0.05, 0]},
    "ellipsoid": {"type": GEOM.mjGEOM_ELLIPSOID, "size": [0.07, 0.06, 0.04]},
    "cylinder": {"type": GEOM.mjGEOM_CYLINDER, "size": [0.05, 0.03, 0]},
    "mesh": {"type": GEOM.mjGEOM_MESH, "meshname": "pebble"},
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("body", ROUND)
def test_bodies_in_any_pose_give_their_momentum_to_the_side_they_hit(body: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    spec = mesh_spec(limbed(0.04), "free" if seed % 2 else None, condim=1)
    V, F = peanut(0.06)
    pebble = 0.05 * V / np.linalg.norm(V, axis=1, keepdims=True)
    spec.add_mesh(name="pebble", uservert=pebble.ravel(), userface=F.ravel())
    spec.option.gravity = [0, 0, 0]
    add_ball(spec, "body", [0, 0, 9], condim=1, **ROUND[body])
    run = Run(spec, "target")
    data = run.data
    waves = run.ripples["target"]
    mujoco.mj_forward(run.model, data)
    joint = run.model.joint(run.model.body("body").jntadr[0])
    first_position = joint.qposadr[0]
    first_velocity = joint.dofadr[0]
    velocity = slice(first_velocity, first_velocity + 3)
    # thrown at the target from 0.6 m away, in any direction, pose and spin
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    data.qpos[first_position : first_position + 7] = [
        *(data.geom("target").xpos + 0.6 * direction),
        *rng.standard_normal(4),
    ]
    data.qvel[velocity] = -2 * direction + rng.uniform(-0.1, 0.1, 3)
    data.qvel[first_velocity + 3 : first_velocity + 6] = rng.uniform(-3, 3, 3)
    lost = 0.0
    while data.time < 0.5:
        before = data.qvel[velocity].copy()
        hits = run.step()
        change = BALL_MASS * (data.qvel[velocity] - before)
        lost += float(np.linalg.norm(change))
        rotation = data.geom("target").xmat.reshape(3, 3)
        for hit in hits:
            assert rotation @ waves.atlas.normals[hit.texel] @ change > 0
    assert run.given() > 0.1
    assert run.given() == pytest.approx(lost, rel=0.03)
    assert -waves.momentum() == pytest.approx(run.given(), rel=0.03)


def test_impulses_lie_where_the_balls_are_nearest_to_the_true_surface() -> None:
    spec = mesh_spec(peanut(0.03))
    spec.option.gravity = [0, 0, 0]
    rng = np.random.default_rng(0)
    # one side collides with the other alone: the balls pass through each other
    spec.flex("target").contype = 2
    spec.flex("target").conaffinity = 0
    directions = rng.standard_normal((30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for i, direction in enumerate(directions):
        start = np.array([0.1, -0.2, 0.3]) + 0.5 * direction + rng.uniform(-0.03, 0.03, 3)
        add_ball(
            spec,
            f"ball {i}",
            start.tolist(),
            size=[0.02, 0, 0],
            contype=0,
            conaffinity=2,
            solref=[0.01, 1.0],
        )
    run = Run(spec, "target", resolution=48)
    off = []
    data = run.data
    waves = run.ripples["target"]
    atlas = waves.atlas
    texel = np.sqrt(atlas.areas.mean())
    data.qvel.reshape(-1, 6)[:, :3] = -directions
    while data.time < 0.6:
        for hit in run.step():
            nearest, _ = atlas.project(waves.from_world(data.geom(hit.other).xpos))
            off.append(np.linalg.norm(waves.from_world(hit.point) - nearest))
    assert len(run.pairs) == len(directions)
    assert np.median(off) < 0.3 * texel
    assert np.quantile(off, 0.99) < texel


@pytest.mark.parametrize("route", ["flex", "convex"])
def test_two_targets_ripple_with_one_momentum(route: str) -> None:
    if route == "convex":
        pytest.importorskip("coacd")
    V, F = peanut(0.05)
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, 0]
    spec.add_mesh(name="shape", uservert=V.ravel(), userface=F.ravel())
    for name, height in (("lower", 0.0), ("upper", 0.45)):
        body = spec.worldbody.add_body(name=name, pos=[0.01, 0.02, height])
        body.add_freejoint()
        body.add_geom(name=name, type=GEOM.mjGEOM_MESH, meshname="shape", mass=2.0)
        make_collidable(spec, name, route)
    run = Run(spec, "lower", "upper")
    run.data.qvel[8] = -1.5
    run.until(0.3)
    lost = 2.0 * np.linalg.norm(run.data.qvel[6:9] - [0, 0, -1.5])
    assert lost > 0.5
    assert run.pairs == {("lower", "upper"), ("upper", "lower")}
    assert [run.given("lower"), run.given("upper")] == pytest.approx([lost] * 2, rel=0.03)


@pytest.mark.parametrize("targets", [["target", "body"], ["body"]])
def test_a_rippling_geom_that_hits_a_flex_receives_the_momentum_it_loses(
    targets: list[str],
) -> None:
    spec = mesh_spec(limbed(0.04), condim=1)
    spec.option.gravity = [0, 0, 0]
    add_ball(spec, "body", [0, 0, 9], condim=1, **ROUND["cylinder"])
    run = Run(spec, *targets)
    lost = 0.0
    data = run.data
    mujoco.mj_forward(run.model, data)
    data.qpos[:3] = data.geom("target").xpos + np.array([0, 0, 0.6])
    data.qpos[3:7] = np.random.default_rng(2).standard_normal(4)
    data.qvel[2:6] = -2.0, 3.0, 2.0, 1.0
    for _ in range(150):
        before = data.qvel[:3].copy()
        run.step()
        lost += run.model.body("body").mass[0] * np.linalg.norm(data.qvel[:3] - before)
    assert lost > 0.2
    assert {geom for geom, _ in run.pairs} == set(targets)
    for name in targets:
        assert run.given(name) == pytest.approx(lost, rel=1e-3)


def test_a_flexcomp_with_the_targets_name_is_its_collider() -> None:
    V, F = peanut(0.05)
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><asset>{mesh_asset("shape", V, F)}</asset><worldbody>
        <geom name="target" type="mesh" mesh="shape" contype="0" conaffinity="0"/>
        <flexcomp name="target" type="direct" dim="2" rigid="true" radius="0.004"
          point="{vector(V)}"
        element="{vector(F)}"/></worldbody></mujoco>"""
    )
    add_ball(spec, "ball", [-0.17, 0.01, 0.35])
    run = Run(spec, "target").until(0.25)
    assert run.pairs == {("target", "ball")}
    lost = BALL_MASS * np.linalg.norm(
        run.data.body("ball").cvel[3:] + np.array([0, 0, 9.81]) * run.data.time
    )
    assert run.given() == pytest.approx(lost, rel=0.03)
    assert -run.ripples["target"].momentum() == pytest.approx(lost, rel=0.05)


UP = (0.0, 0.0, 1.0)
ASIDE = (1.0, 0.0, 0.0)


class Slab(NamedTuple):
    """A block, geom 0, that collides through a flex, and a ball; outward normals [triangles, 3]."""

    model: mujoco.MjModel
    normals: np.ndarray


@pytest.fixture(scope="module")
def slab() -> Slab:
    solid = trimesh.creation.box(extents=(1, 1, 1))
    spec = mesh_spec((solid.vertices, solid.faces))
    add_ball(spec, "ball", [0, 0, 9], size=[0.03, 0, 0])
    model = spec.compile()
    corners = target_mesh(model, 0).V[target_mesh(model, 0).F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return Slab(model, normals / np.linalg.norm(normals, axis=1, keepdims=True))


class Loads(NamedTuple):
    """Contacts that are kept [k], and the forces [N] and normals of the kept ones."""

    kept: np.ndarray
    forces: np.ndarray
    normals: np.ndarray


def loads_of(slab: Slab, contacts: list[tuple], surface: tuple[float, ...] | None = UP) -> Loads:
    """The loads of some contacts of the ball with the block.

    A contact is an outward normal and the force on the ball [N]; the surface is the normal of the
    touched triangle, or None for a vertex.
    """
    k = len(contacts)
    x = np.array([normal / np.linalg.norm(normal) for normal, _ in contacts])
    y = np.cross(x, [0.6, -0.7, 0.2])  # any direction that no normal here has
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    frames = np.stack([x, y, np.cross(x, y)], axis=1)
    elements = np.full((k, 2), -1, np.int32)
    if surface is not None:
        elements[:, 0] = (slab.normals @ surface).argmax()
    contact = SimpleNamespace(
        dim=np.full(k, 3, np.int32),
        friction=np.ones((k, 5)),
        elem=elements,
        frame=frames.reshape(k, 9),
        pos=np.zeros((k, 3)),
        dist=np.full(k, -0.002),
        includemargin=np.zeros(k),
    )
    data = SimpleNamespace(contact=contact, geom_xmat=np.tile(np.eye(3).ravel(), (2, 1)))
    rows = np.arange(k), np.zeros(k, int), np.zeros(k, int), np.ones(k, int), np.zeros(1, int)
    along = np.einsum("kij,kj->ki", frames, [force for _, force in contacts])
    flex_contacts = FlexContacts(CoupledModel(slab.model), {0: target_mesh(slab.model, 0)})
    kept, _, forces, normals = flex_contacts.loads(data, *rows, along)
    return Loads(kept, forces, normals)


RIM = [(UP, (0, 0, 3)), (ASIDE, (50, 0, 1)), ((-1, 0, 0), (-50, 0, 2))]


def test_friction_of_sideways_contacts_counts_along_the_surface_normal(slab: Slab) -> None:
    """Opposite contacts at a rim cancel along x; their friction pushes upwards, 3 + 1 + 2 N."""
    # without the surface's normal all three contacts count with their own normals
    assert loads_of(slab, RIM, surface=None).kept.all()
    loads = loads_of(slab, RIM)
    assert loads.kept.tolist() == [True, False, False]
    np.testing.assert_allclose(loads.forces, [6])
    np.testing.assert_allclose(loads.normals, [UP], atol=1e-15)


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("condim", [1, 3, 4, 6])
def test_the_load_is_the_force_with_which_mujoco_moves_the_body(cone: str, condim: int) -> None:
    """A cylinder slides and tumbles on a slab; compare MuJoCo's constraint force each step."""
    slab = trimesh.creation.box(extents=(0.6, 0.6, 0.4))
    V, F = trimesh.remesh.subdivide_to_size(slab.vertices, slab.faces, 0.1)
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><option cone="{cone}"/><default>
        <geom condim="{condim}" friction="0.5 0.01 0.01"/></default>
        <asset>{mesh_asset("m", V, F)}</asset><worldbody><body pos="0.1 0.2 0.3" euler="0 0 20">
        <geom name="slab" type="mesh" mesh="m"/></body><body pos="0.1 0.2 0.57" euler="70 10 0">
        <freejoint/>
        <geom type="cylinder" size="0.05 0.04" mass="0.3"/></body></worldbody></mujoco>"""
    )
    make_collidable(spec, "slab", "flex")
    model = spec.compile()
    data = mujoco.MjData(model)
    coupled = CoupledModel(model)
    wrench = np.zeros(6)
    steps = 0
    reader = ContactReader(coupled, {0: target_atlas(model, 0, 8)})
    data.qvel[:] = [0.4, 0.2, -1.0, 4.0, 2.0, 5.0]
    for _ in range(100):
        mujoco.mj_step(model, data)
        found = reader.read(data)
        mean = np.zeros(3)
        for i, contact in enumerate(data.contact):
            mujoco.mj_contactForce(model, data, i, wrench)
            # the body is the first geom or the second, and is pushed upwards by all that bears
            outward = np.sign(contact.frame[2]) * contact.frame[:3]
            mean += wrench[0] * outward * (abs(outward[2]) > 0.1)
        if mean.any():
            [contacts] = found.values()
            along = data.qfrc_constraint[:3] @ mean / np.linalg.norm(mean)
            assert contacts.forces.sum() == pytest.approx(along, rel=1e-9, abs=1e-9)
            steps += 1
        else:
            assert not found
    assert steps > 20


@pytest.mark.parametrize(
    ("contacts", "unexplained"),
    [
        # a normal force, and friction of up to its own amount beside it
        ([(UP, (0, 0, 4))], 0.0),
        ([(UP, (3, 0, 4))], 0.0),
        # two slanted pushes that balance: their sum is the whole
        ([((0.6, 0, 0.8), (3, 0, 4)), ((-0.6, 0, 0.8), (-3, 0, 4))], 0.0),
        # 4 N up, with friction of 4 N at most, where 12 N push sideways
        ([(UP, (0, 0, 4)), (ASIDE, (12, 0, 0))], 1 - np.hypot(4, 4) / np.hypot(12, 4)),
        # nothing pushes along the surface's normal
        ([(ASIDE, (5, 0, 0))], 1.0),
    ],
)
def test_warning_about_pushes_sideways_beyond_friction(
    slab: Slab, contacts: list, unexplained: float
) -> None:
    with warnings.catch_warnings(record=True, action="always", category=RippleWarning) as caught:
        loads_of(slab, contacts)
    messages = [str(warning.message) for warning in caught]
    assert len(messages) == (1 if unexplained else 0)
    assert all(f"wrong by about {unexplained:.1%}" in message for message in messages)
