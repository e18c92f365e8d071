"""Contacts off the surface find the nearest part of it that faces them.

Contacts of collision geoms load the visible surface: the whole force, once, on the right target and side.
"""

import mujoco
import numpy as np
import pytest
import trimesh
from mujoco_models import BALL, mesh_asset, model_of

from ripple_sim import Material, Ripples, make_collidable
from ripple_sim.coupling.contacts import places_facing
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas


@pytest.fixture(scope="module")
def plate() -> Atlas:
    """1 m by 1 m, 0.1 m thick."""
    solid = trimesh.creation.box(extents=(1, 1, 0.1)).subdivide_to_size(0.1)
    return build_atlas(Mesh.from_arrays(solid.vertices, solid.faces), 24, cache=False)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("height", [-0.2, -0.04, 0.0, 0.04, 0.2])
def test_contact_with_a_thin_part_is_placed_on_its_own_side(plate: Atlas, side: float, height: float) -> None:
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-0.35, 0.35, (20, 2)), np.full(20, height)])
    normals = np.tile([0.0, 0.0, side], (20, 1))
    placed = places_facing(plate, points, normals)
    np.testing.assert_allclose(placed[:, 2], 0.05 * side, atol=1e-12)
    # on the other side to a texel, or else straight above
    nearer = abs(height - 0.05 * side) < abs(height + 0.05 * side)
    off = np.linalg.norm((placed - points)[:, :2], axis=1)
    assert off.max() < (1e-6 if nearer else 1.5 * np.sqrt(plate.areas.max()))


def test_point_is_the_nearest_of_all_that_face_the_contact(animal: Atlas) -> None:
    rng = np.random.default_rng(4)
    positions, outward = animal.positions.reshape(-1, 3), animal.normals.reshape(-1, 3)
    points = rng.choice(positions, 60) + rng.normal(0, 0.03, (60, 3))
    normals = rng.standard_normal((60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    texel = np.sqrt(animal.areas.max())
    for point, normal, place in zip(points, normals, places_facing(animal, points, normals), strict=True):
        [there] = animal.nearest_texel(place)
        assert outward[there] @ normal > 0
        least = np.linalg.norm(positions[outward @ normal > 0.25] - point, axis=1).min()
        assert np.linalg.norm(place - point) <= least + 1e-9
        assert np.linalg.norm(positions[there] - place) < texel


def test_where_nothing_faces_a_contact_the_nearest_point_is_taken() -> None:
    atlas = sphere_atlas(1.0, 8)
    [place] = places_facing(atlas, np.array([[0.0, 0.0, 1.1]]), np.zeros((1, 3)))
    np.testing.assert_allclose(place, [0, 0, 1], atol=0.02)


MASS = 0.3
SEEN = 'contype="0" conaffinity="0" group="2"'


def play(model: mujoco.MjModel, targets: tuple[str, ...], seconds: float = 0.3, **options: object) -> tuple:
    """Run; the ripples, the records with the data's poses, and the momentum that the ball lost [N s]."""
    data = mujoco.MjData(model)
    material = Material(speed=0.5, density=50.0)
    ripples = Ripples(
        model, dict.fromkeys(targets, material), resolution=24, backend="cpu", conserve_volume=False, **options
    )
    start, record, lost = model.joint(model.body("ball").jntadr[0]).dofadr[0], [], np.zeros(3)
    joint = slice(start, start + 3)
    while data.time < seconds:
        before = data.qvel[joint].copy()
        mujoco.mj_step(model, data)
        ripples.step(data)
        lost += MASS * (data.qvel[joint] - before - model.opt.gravity * model.opt.timestep)
        record += [(each, data.geom(each.geom).xpos.copy()) for each in ripples.last_impulses]
    return ripples, record, float(np.linalg.norm(lost))


def slab(offset: float, body: str = "") -> mujoco.MjModel:
    """A plate of 0.1 m that is seen, and a thinner one inside that collides."""
    solid = trimesh.creation.box(extents=(1, 1, 0.1)).subdivide_to_size(0.1)
    link = f"""<body name="link">{body}<geom name="plate" type="mesh" mesh="plate" mass="3" {SEEN}/>
        <geom name="core" type="box" size="0.5 0.5 0.005" pos="0 0 {offset}" mass="0" group="3"/></body>"""
    return model_of(link + BALL.format(f"0.13 -0.07 {offset + 0.2}"), mesh_asset("plate", solid.vertices, solid.faces))


@pytest.mark.parametrize("offset", [-0.03, 0.0, 0.03])
def test_visible_plate_is_loaded_on_the_side_that_is_hit_with_all_that_the_ball_loses(offset: float) -> None:
    """The lower side is nearer to a core that lies low. Nothing was given to a geom that does not collide itself."""
    ripples, record, lost = play(slab(offset), ("plate",))
    given = sum(each.impulse for each, _ in record)
    assert lost > 0.5
    assert given == pytest.approx(lost, rel=0.01)
    assert -ripples["plate"].momentum() == pytest.approx(given, rel=1e-4)
    texel = np.sqrt(ripples["plate"].atlas.areas.max())
    for each, position in record:
        assert (each.geom, each.other) == ("plate", "ball")
        np.testing.assert_allclose(each.point - position, [0.13, -0.07, 0.05], atol=1.5 * texel)
        assert each.point[2] - position[2] == pytest.approx(0.05, abs=1e-9)


@pytest.mark.parametrize("joint", ["<freejoint/>", '<joint axis="0 1 0" pos="-0.5 0 0"/>'])
def test_moving_body_with_collision_geoms_keeps_momentum(joint: str) -> None:
    model = slab(0.02, joint)
    model.opt.gravity[:] = 0
    model.qpos0[-5] = 0.15  # the ball's height
    data = mujoco.MjData(model)
    data.qvel[-4] = -2.0
    ripples = Ripples(model, {"plate": Material(density=50)}, resolution=16, backend="cpu", conserve_volume=False)
    given = 0.0
    while data.time < 0.4:
        mujoco.mj_step(model, data)
        ripples.step(data)
        given += sum(each.impulse for each in ripples.last_impulses)
    assert given == pytest.approx(MASS * np.linalg.norm(data.qvel[-6:-3] - [0, 0, -2.0]), rel=0.01)


ARM = f"""<body name="arm" pos="0 0 0.5">
<geom name="left" type="capsule" fromto="-0.5 0 0 0 0 0" size="0.1" {SEEN}/>
<geom name="right" type="capsule" fromto="0 0 0 0.5 0 0" size="0.1" {SEEN}/>
<geom name="bone" type="capsule" fromto="-0.5 0 0 0.5 0 0" size="0.09" group="3"/></body>"""


@pytest.mark.parametrize(("x", "expected"), [(-0.4, {"left"}), (0.4, {"right"})])
def test_targets_that_share_a_geom_get_each_contact_once(x: float, expected: set[str]) -> None:
    _, record, lost = play(model_of(ARM + BALL.format(f"{x} 0.01 0.8")), ("left", "right"))
    assert {each.geom for each, _ in record} == expected
    assert sum(each.impulse for each, _ in record) == pytest.approx(lost, rel=0.01)


def test_a_plank_across_two_targets_weighs_on_both_what_it_weighs() -> None:
    plank = """<body name="ball" pos="0 0 0.605"><freejoint/>
        <geom name="plank" type="box" size="0.4 0.05 0.015" mass="0.3"/></body>"""
    _, record, lost = play(model_of(ARM + plank), ("left", "right"), 0.5)
    given = {name: sum(each.impulse for each, _ in record if each.geom == name) for name in ("left", "right")}
    assert given["left"] + given["right"] == pytest.approx(lost, rel=0.01)
    assert given["left"] == pytest.approx(given["right"], rel=0.1)


@pytest.mark.filterwarnings("ignore:geom .* collides as")
def test_named_geoms_alone_load_a_target_that_names_them() -> None:
    arm = ARM.replace("</body>", '<geom name="knob" size="0.12" pos="0.4 0 0"/></body>')
    model = model_of(arm + BALL.format("0.4 0.01 0.8"))
    _, _, lost = play(model, ("left",), contacts={"left": ["bone"]})
    _, bone, _ = play(model, ("left",), contacts={"left": ["bone"]})
    _, knob, _ = play(model, ("right",), contacts={"right": ["knob"]})
    assert not bone
    assert sum(each.impulse for each, _ in knob) == pytest.approx(lost, rel=0.01)


def test_two_links_that_are_only_visible_hit_each_other_with_one_momentum() -> None:
    fist = f"""<body name="ball" pos="0.3 0 0.8"><freejoint/><geom name="fist" size="0.06" {SEEN} mass="0"/>
        <geom name="core" size="0.05" mass="{MASS}"/></body>"""
    _, record, lost = play(model_of(ARM + fist), ("right", "fist"))
    given = {name: sum(each.impulse for each, _ in record if each.geom == name) for name in ("right", "fist")}
    assert {(each.geom, each.other) for each, _ in record} == {("right", "core"), ("fist", "bone")}
    assert given["right"] == pytest.approx(lost, rel=0.01)
    assert given["fist"] == pytest.approx(lost, rel=0.01)


@pytest.mark.filterwarnings("ignore:geom .* collides as")
def test_collision_geom_with_a_flex_collider_and_the_target_that_it_stands_for() -> None:
    """A visible ball around an animal that collides through a flex."""
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><option timestep="0.001"/><asset>{mesh_asset("animal", *limbed(0.05))}</asset><worldbody>
        <body name="link"><geom name="shell" size="0.5" {SEEN}/><geom name="core" type="mesh" mesh="animal"/></body>
        {BALL.format("-0.03 0 0.7")}</worldbody></mujoco>"""
    )
    make_collidable(spec, "core", "flex")
    _, record, lost = play(spec.compile(), ("shell",), 0.5)
    assert {(each.geom, each.other) for each, _ in record} == {("shell", "ball")}
    assert lost > 0.3
    assert sum(each.impulse for each, _ in record) == pytest.approx(lost, rel=0.03)


def test_surface_that_is_only_visible_pushes_back() -> None:
    """A raised bump lifts a ball that rests on the collision geom under it."""
    model = model_of(ARM + BALL.format("0.3 0 0.651"))
    heights = {}
    for two_way in (False, True):
        data = mujoco.MjData(model)
        ripples = Ripples(model, {"right": Material(density=200)}, resolution=24, backend="cpu", two_way=two_way)
        waves = ripples["right"]
        while data.time < 0.3:
            if data.time == 0:
                mujoco.mj_forward(model, data)
                waves.add_impulse(ripples.to_geom("right", [0.3, 0, 0.1]), -2.0, 0.06)
            mujoco.mj_step(model, data)
            ripples.step(data)
            heights[two_way] = max(heights.get(two_way, 0.0), float(data.qpos[2]))
    assert heights[True] > heights[False] + 0.002
