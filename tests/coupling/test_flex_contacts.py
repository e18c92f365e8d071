"""Contacts with flex colliders: the right place, the right amount, under the right name.

The load of contacts with a flex collider is the sum of their whole forces, along their mean normal.
"""

import warnings
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import trimesh
from mujoco_models import add_ball, mesh_asset, mesh_spec

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.coupling.contacts import ContactReader
from ripple_sim.coupling.flex_contacts import FlexContacts
from ripple_sim.coupling.model import CoupledModel
from ripple_sim.coupling.target_mesh import target_atlas, target_mesh
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


UP, ASIDE = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def slab() -> tuple[mujoco.MjModel, np.ndarray]:
    """A block that collides through a flex, geom 0, with a ball of 0.03 m; and the outward normals of its triangles."""
    solid = trimesh.creation.box(extents=(1, 1, 1))
    spec = mesh_spec((solid.vertices, solid.faces))
    add_ball(spec, "ball", [0, 0, 9], size=[0.03, 0, 0])
    model = spec.compile()
    corners = target_mesh(model, 0).V[target_mesh(model, 0).F]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return model, normals / np.linalg.norm(normals, axis=1, keepdims=True)


def frame_along(normal: np.ndarray) -> np.ndarray:
    """Rows of a frame: a normal, and two directions across it."""
    x = np.array(normal) / np.linalg.norm(normal)
    y = np.cross(x, [0.6, -0.7, 0.2])
    y /= np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])


def summed(
    slab: tuple[mujoco.MjModel, np.ndarray],
    contacts: list[tuple[tuple[float, ...], tuple[float, float, float]]],
    *,
    surface: tuple[float, ...] | None = UP,
    swapped: bool = False,
    rotation: np.ndarray = np.eye(3),  # noqa: B008
    dist: float = -0.002,
    margin: float = 0.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Which contacts of the ball with the block are kept, and their points (from MuJoCo's), forces and normals.

    Parameters
    ----------
    contacts
        Outward normal, and force on the ball in the world [N], of each.
    surface
        Normal of the triangle that is touched in the world; None for a vertex.
    swapped
        Whether the ball is the first geom of the contacts.
    rotation
        Of the block.
    """
    model, normals = slab
    k, side = len(contacts), int(swapped)
    frames = np.array([frame_along(np.multiply(-1 if swapped else 1, normal)) for normal, _ in contacts])
    forces = np.array([force for _, force in contacts]) * (-1 if swapped else 1)
    elements = np.full((k, 2), -1, np.int32)
    if surface is not None:
        elements[:, side] = (normals @ rotation.T @ surface).argmax()
    contact = SimpleNamespace(
        dim=np.full(k, 3, np.int32), friction=np.ones((k, 5)), elem=elements, frame=frames.reshape(k, 9),
        pos=np.arange(3.0 * k).reshape(k, 3), dist=np.full(k, dist), includemargin=np.full(k, margin),
    )  # fmt: skip
    data = SimpleNamespace(contact=contact, geom_xmat=np.tile(rotation.ravel(), (2, 1)))
    coupled, rows = CoupledModel(model), (np.arange(k), np.full(k, side), np.zeros(k, int), np.ones(k, int))
    along = np.einsum("kij,kj->ki", frames, forces)
    kept, points, *loads = FlexContacts(coupled, {0: target_mesh(model, 0)}).loads(data, *rows, np.zeros(1, int), along)
    return kept, points - contact.pos[kept], *loads


RIM = [(UP, (0, 0, 3)), (ASIDE, (50, 0, 1)), ((-1, 0, 0), (-50, 0, 2))]


def test_friction_of_contacts_that_push_sideways_counts_along_the_normal(slab: tuple) -> None:
    """Two opposite contacts at a rim cancel along x, but their friction pushes upwards: 3 + 1 + 2 N."""
    assert summed(slab, RIM, surface=None)[0].all(), "without the surface's normals all three would count as normals"
    kept, _, forces, normals = summed(slab, RIM)
    assert kept.tolist() == [True, False, False]
    np.testing.assert_allclose(forces, [6])
    np.testing.assert_allclose(normals, [UP], atol=1e-15)


def test_the_load_is_shared_by_normal_force_and_by_how_straight_it_is(slab: tuple) -> None:
    _, _, forces, _ = summed(slab, [(UP, (0, 0, 4)), ((0.6, 0.0, 0.8), (1.2, 0, 1.6))])
    # 4 and 2 N along their own normals; the whole force of (1.2, 0, 5.6) lies along their mean normal as it is
    assert forces.sum() == pytest.approx(np.hypot(1.2, 5.6))
    assert forces[1] / forces[0] == pytest.approx(2 * 0.8**2 / 4)


@pytest.mark.filterwarnings("ignore:the impulses on geom")
@pytest.mark.parametrize(
    "contacts",
    [
        [(UP, (0, 0, -2))],
        [(UP, (0, 0, 1)), (ASIDE, (0, 0, -3))],
        [(ASIDE, (5, 0, 0)), ((0, 1, 0), (0, 5, 0))],
        [(UP, (0, 0, 0))],
    ],
    ids=["pulled", "pulled in sum", "sideways only", "no force"],
)
def test_a_pair_that_does_not_push_is_left_out(slab: tuple, contacts: list) -> None:
    assert [len(each) for each in summed(slab, contacts)[1:]] == [0, 0, 0]


def test_it_does_not_matter_which_of_the_two_mujoco_names_first(slab: tuple) -> None:
    contacts = [(UP, (1, 0, 3)), ((0.6, 0, 0.8), (0, 1, 5)), (ASIDE, (4, 0, 2))]
    for one, other in zip(summed(slab, contacts), summed(slab, contacts, swapped=True), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-14)


@pytest.mark.parametrize(
    ("dist", "margin", "height"),
    [(-0.002, 0.0, -0.001 + 2 * 0.002), (-0.1, 0.0, -0.05 + 0.1 + 0.03), (0.01, 0.014, 0.005 + 2 * 0.004)],
    ids=["shallow", "deeper than the ball", "within the margin"],
)
def test_points_lie_outside_by_the_depth_but_not_by_more_than_the_geom(
    slab: tuple, dist: float, margin: float, height: float
) -> None:
    """MuJoCo's point is half-way between the two surfaces, the ball's is out by its depth in the margin, twice."""
    _, [point], _, _ = summed(slab, [(UP, (0, 0, 3))], dist=dist, margin=margin)
    assert point[2] == pytest.approx(height)


def test_normals_turn_with_the_geom(slab: tuple) -> None:
    rotation = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    np.testing.assert_allclose(summed(slab, [(UP, (0, 0, 3))], rotation=rotation)[3], [UP], atol=1e-15)


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("condim", [1, 3, 4, 6])
def test_the_load_is_the_force_with_which_mujoco_moves_the_body(cone: str, condim: int) -> None:
    """A cylinder that slides and tumbles on a slab, step by step against MuJoCo's constraint force on its joint."""
    slab = trimesh.creation.box(extents=(0.6, 0.6, 0.4))
    V, F = trimesh.remesh.subdivide_to_size(slab.vertices, slab.faces, 0.1)
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><option cone="{cone}"/><default><geom condim="{condim}" friction="0.5 0.01 0.01"/></default>
        <asset>{mesh_asset("m", V, F)}</asset><worldbody><body pos="0.1 0.2 0.3" euler="0 0 20">
        <geom name="slab" type="mesh" mesh="m"/></body><body pos="0.1 0.2 0.57" euler="70 10 0"><freejoint/>
        <geom type="cylinder" size="0.05 0.04" mass="0.3"/></body></worldbody></mujoco>"""
    )
    make_collidable(spec, "slab", "flex")
    model = spec.compile()
    data, coupled, wrench, steps = mujoco.MjData(model), CoupledModel(model), np.zeros(6), 0
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
def test_the_share_of_pushes_sideways_beyond_friction_is_warned_of(
    slab: tuple, contacts: list, unexplained: float
) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RippleWarning)
        summed(slab, contacts)
    assert [f"wrong by about {unexplained:.1%}" in str(each.message) for each in caught] == [True] * int(
        unexplained > 0
    )
