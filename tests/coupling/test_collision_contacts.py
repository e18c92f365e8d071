"""Contacts of collision geoms load the nearest front part of the visible surface, once."""

import re
import warnings

import mujoco
import numpy as np
import pytest
import trimesh
from hits import Run
from mujoco_models import BALL, add_ball, mesh_asset, mesh_spec, model_of

from ripple_sim import Material, Ripples, RippleWarning, Target, make_collidable
from ripple_sim.coupling import hull_gap, places_facing
from ripple_sim.scenes.shapes import limbed, peanut
from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas


@pytest.fixture(scope="module")
def plate() -> Atlas:
    """1 m by 1 m, 0.1 m thick."""
    solid = trimesh.creation.box(extents=(1, 1, 0.1)).subdivide_to_size(0.1)
    return build_atlas(Mesh.from_arrays(solid.vertices, solid.faces), 24, cache=False)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("height", [-0.2, -0.04, 0.0, 0.04, 0.2])
def test_contact_with_a_thin_part_is_placed_on_its_own_side(
    plate: Atlas, side: float, height: float
) -> None:
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-0.35, 0.35, (20, 2)), np.full(20, height)])
    normals = np.tile([0.0, 0.0, side], (20, 1))
    placed = places_facing(plate, points, normals)
    np.testing.assert_allclose(placed[:, 2], 0.05 * side, atol=1e-12)
    # on the other side to a texel, or else straight above
    nearer = abs(height - 0.05 * side) < abs(height + 0.05 * side)
    off = np.linalg.norm((placed - points)[:, :2], axis=1)
    assert off.max() < (1e-6 if nearer else 1.5 * np.sqrt(plate.areas.max()))


def test_a_contact_is_placed_at_the_nearest_point_that_faces_it(animal: Atlas) -> None:
    rng = np.random.default_rng(4)
    positions = animal.positions.reshape(-1, 3)
    outward = animal.normals.reshape(-1, 3)
    points = rng.choice(positions, 60) + rng.normal(0, 0.03, (60, 3))
    normals = rng.standard_normal((60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    texel = np.sqrt(animal.areas.max())
    for point, normal, place in zip(
        points, normals, places_facing(animal, points, normals), strict=True
    ):
        [there] = animal.nearest_texel(place)
        assert outward[there] @ normal > 0
        least = np.linalg.norm(positions[outward @ normal > 0.25] - point, axis=1).min()
        assert np.linalg.norm(place - point) <= least + 1e-9
        assert np.linalg.norm(positions[there] - place) < texel


def test_a_contact_that_no_point_faces_is_placed_at_the_nearest_point() -> None:
    atlas = sphere_atlas(1.0, 8)
    [place] = places_facing(atlas, np.array([[0.0, 0.0, 1.1]]), np.zeros((1, 3)))
    np.testing.assert_allclose(place, [0, 0, 1], atol=0.02)


MASS = 0.3
SEEN = 'contype="0" conaffinity="0" group="2"'


def play(
    model: mujoco.MjModel, targets: tuple[str, ...], seconds: float = 0.3, **options: object
) -> tuple:
    """The run, and the momentum that the ball lost [N s]."""
    run = Run(model, *targets, resolution=24, **options).until(seconds)
    velocity = run.data.qvel[model.body("ball").dofadr[0] :][:3]
    return run, MASS * float(np.linalg.norm(velocity - model.opt.gravity * run.data.time))


def slab(offset: float, body: str = "") -> mujoco.MjModel:
    """A plate of 0.1 m that is seen, and a thinner one inside that collides."""
    solid = trimesh.creation.box(extents=(1, 1, 0.1)).subdivide_to_size(0.1)
    link = f"""<body name="link">{body}<geom name="plate" type="mesh" mesh="plate" mass="3" {SEEN}/>
        <geom name="core" type="box" size="0.5 0.5 0.005" pos="0 0 {offset}" mass="0" group="3"/>
        </body>"""
    return model_of(
        link + BALL.format(f"0.13 -0.07 {offset + 0.2}"),
        mesh_asset("plate", solid.vertices, solid.faces),
    )


@pytest.mark.parametrize("offset", [-0.03, 0.0, 0.03])
def test_a_visible_plate_gets_the_whole_momentum_on_the_side_that_is_hit(
    offset: float,
) -> None:
    """The lower side is nearer to a core that lies low.

    Nothing was given to a geom that does not collide itself.
    """
    run, lost = play(slab(offset), ("plate",))
    assert lost > 0.5
    assert run.given() == pytest.approx(lost, rel=0.01)
    assert -run.ripples["plate"].momentum() == pytest.approx(run.given(), rel=1e-4)
    assert run.pairs == {("plate", "ball")}
    points = (
        np.array([hit.point for hits in run.hits for hit in hits]) - run.data.geom("plate").xpos
    )
    texel = np.sqrt(run.ripples["plate"].atlas.areas.max())
    np.testing.assert_allclose(
        points[:, :2], np.tile([0.13, -0.07], (len(points), 1)), atol=1.5 * texel
    )
    np.testing.assert_allclose(points[:, 2], 0.05, atol=1e-9)


ARM = f"""<body name="arm" pos="0 0 0.5">
<geom name="left" type="capsule" fromto="-0.5 0 0 0 0 0" size="0.1" {SEEN}/>
<geom name="right" type="capsule" fromto="0 0 0 0.5 0 0" size="0.1" {SEEN}/>
<geom name="bone" type="capsule" fromto="-0.5 0 0 0.5 0 0" size="0.09" group="3"/></body>"""


@pytest.mark.parametrize(("x", "expected"), [(-0.4, "left"), (0.4, "right")])
def test_targets_that_share_a_geom_get_each_contact_once(x: float, expected: str) -> None:
    run, lost = play(model_of(ARM + BALL.format(f"{x} 0.01 0.8")), ("left", "right"))
    assert run.pairs == {(expected, "ball")}
    assert run.given() == pytest.approx(lost, rel=0.01)


def test_a_plank_across_two_targets_presses_on_both_with_its_weight() -> None:
    plank = """<body name="ball" pos="0 0 0.605"><freejoint/>
        <geom name="plank" type="box" size="0.4 0.05 0.015" mass="0.3"/></body>"""
    run, lost = play(model_of(ARM + plank), ("left", "right"), 0.5)
    assert run.given() == pytest.approx(lost, rel=0.01)
    assert run.given("left") == pytest.approx(run.given("right"), rel=0.1)


@pytest.mark.filterwarnings("ignore:geom .* collides as")
def test_a_target_with_named_contacts_is_loaded_by_these_geoms_alone() -> None:
    arm = ARM.replace("</body>", '<geom name="knob" size="0.12" pos="0.4 0 0"/></body>')
    model = model_of(arm + BALL.format("0.4 0.01 0.8"))
    bone, lost = play(model, ("left",), contacts=["bone"])
    knob, _ = play(model, ("right",), contacts=["knob"])
    assert not bone.pairs
    assert knob.given() == pytest.approx(lost, rel=0.01)


def test_two_visible_targets_that_hit_each_other_get_equal_momentum() -> None:
    fist = f"""<body name="ball" pos="0.3 0 0.8"><freejoint/>
    <geom name="fist" size="0.06" {SEEN} mass="0"/>
        <geom name="core" size="0.05" mass="{MASS}"/></body>"""
    run, lost = play(model_of(ARM + fist), ("right", "fist"))
    assert run.pairs == {("right", "core"), ("fist", "bone")}
    assert [run.given("right"), run.given("fist")] == pytest.approx([lost] * 2, rel=0.01)


@pytest.mark.filterwarnings("ignore:geom .* collides as")
def test_a_visible_target_is_loaded_through_the_flex_of_its_collision_geom() -> None:
    """A visible ball around an animal that collides through a flex."""
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><option timestep="0.001"/><asset>{mesh_asset("animal", *limbed(0.05))}</asset>
        <worldbody>
        <body name="link"><geom name="shell" size="0.5" {SEEN}/>
        <geom name="core" type="mesh" mesh="animal"/></body>
        {BALL.format("-0.03 0 0.7")}</worldbody></mujoco>"""
    )
    make_collidable(spec, "core", "flex")
    run, lost = play(spec.compile(), ("shell",), 0.5)
    assert run.pairs == {("shell", "ball")}
    assert lost > 0.3
    assert run.given() == pytest.approx(lost, rel=0.03)


def test_surface_that_is_only_visible_pushes_back() -> None:
    """A raised bump lifts a ball that rests on the collision geom under it."""
    model = model_of(ARM + BALL.format("0.3 0 0.651"))
    heights = {}
    for two_way in (False, True):
        run = Run(model, "right", density=200, resolution=24, conserve_volume=True, two_way=two_way)
        run.ripples["right"].add_impulse(run.ripples.to_geom("right", [0.3, 0, 0.1]), -2.0, 0.06)
        heights[two_way] = max(run.until(0.001 * step).data.qpos[2] for step in range(1, 301))
    assert heights[True] > heights[False] + 0.002


def test_the_gap_of_a_hull_is_the_depth_of_the_waist() -> None:
    V, F = peanut(0.03)
    widest = np.hypot(V[:, 1], V[:, 2]).max()
    waist = np.hypot(V[:, 1], V[:, 2])[np.abs(V[:, 0]) < 0.01].min()
    atlas = build_atlas(Mesh.from_arrays(V, F), 16, cache=False)
    assert hull_gap(atlas) == pytest.approx(widest - waist, rel=0.1)


def test_warning_about_a_hull_names_geom_and_distance() -> None:
    model = mesh_spec(limbed(0.05), route=None).compile()
    with pytest.warns(RippleWarning, match=r"geom 'target'.*hull, up to 0\.\d+ m.*make_collidable"):
        Ripples(model, {"target": Material()}, resolution=8, backend="cpu")


def test_no_warning_without_a_gap_or_without_collisions() -> None:
    V, F = peanut(0.05)
    convex = mesh_spec((0.3 * V / np.linalg.norm(V, axis=1, keepdims=True), F), route=None)
    ghost = mesh_spec(limbed(0.05), route=None)
    ghost.geom("target").contype = ghost.geom("target").conaffinity = 0
    true = mesh_spec(limbed(0.05), route=None)
    make_collidable(true, "target")
    with warnings.catch_warnings(action="error"):
        for spec in (convex, ghost, true):
            Ripples(spec.compile(), {"target": Material()}, resolution=8, backend="cpu")


def test_geoms_that_collide_badly_with_a_flex_are_named() -> None:
    spec = mesh_spec(peanut(0.06), "free")
    arm = (base := spec.body("base")).add_body(name="arm", pos=[0, 0, 0.5])
    arm.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE)
    arm.add_geom(name="arm", size=[0.05, 0, 0], mass=0.1)
    base.add_body(name="horn", pos=[0, 0, 0.4]).add_geom(name="horn", size=[0.05, 0, 0], mass=0.1)
    add_ball(spec, "excluded", [0, 0, 2])
    spec.add_exclude(bodyname1="excluded", bodyname2="base")
    add_ball(spec, "ball", [0, 0, 3])
    add_ball(spec, "pebble", [0, 0, 4], type=mujoco.mjtGeom.mjGEOM_SDF, meshname="shape")
    add_ball(spec, "crate", [0, 0, 5], type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])
    with pytest.warns(RippleWarning) as caught:
        Ripples(spec.compile(), {"target": Material(density=10.0)}, resolution=8, backend="cpu")
    [message] = [str(warning.message) for warning in caught]
    told = "boxes ('crate') aside", "SDF geoms ('pebble') sink", "excluded ('arm', 'excluded')"
    assert all(each in message for each in ("'target' collides through a flex", *told))
    for geom in ("crate", "pebble", "arm", "excluded"):
        spec.geom(geom).contype = spec.geom(geom).conaffinity = 0
    with warnings.catch_warnings(action="error"):
        Ripples(spec.compile(), {"target": Material(density=10.0)}, resolution=8, backend="cpu")


LINK = '<body name="link">{}</body>' + BALL.format("0 0 2")


@pytest.mark.parametrize(
    ("link", "target", "message"),
    [
        (
            f'<geom name="shell" size="0.3" {SEEN}/>',
            Target(),
            r"does not collide .*Target\(contacts=\[\.\.\.\]\)",
        ),
        (
            '<geom name="shell" size="0.3" contype="4" conaffinity="4"/>',
            Target(),
            "'shell' has contype 4 and conaffinity 4",
        ),
        (
            (
                f'<geom name="shell" size="0.3" {SEEN}/><geom name="core" size="0.29" contype="0" '
                f'conaffinity="2"/>'
            ),
            Target(),
            (
                "nothing can touch geom 'shell': 'core' has contype 0 and conaffinity 2, which "
                "match "
                "no geom"
            ),
        ),
        (
            f'<geom name="shell" size="0.3" {SEEN}/><geom size="0.3"/>',
            Target(contacts=[]),
            "nothing can touch geom 'shell'",
        ),
    ],
)
def test_warning_about_a_target_that_nothing_can_touch(
    link: str, target: Target, message: str
) -> None:
    with pytest.warns(RippleWarning, match=message):
        Ripples(model_of(LINK.format(link)), {"shell": target}, resolution=8, backend="cpu")


@pytest.mark.parametrize(
    ("core", "gap"),
    [
        ('<geom name="core" size="0.2"/>', 0.1),
        ('<geom name="core" size="0.4"/>', 0.1),
        ('<geom name="core" size="0.3" pos="0 0 0.12"/>', 0.12),
        ('<geom name="core" type="box" size="0.28 0.28 0.28"/>', None),
        ('<geom name="core" size="0.3" pos="0 0 0.02"/><geom name="other" size="0.2"/>', None),
        # named below, since planes and height fields are not taken by themselves
        ('<geom name="core" type="plane" size="1 1 1" pos="0 0 0.29"/>', None),
        ('<geom name="core" type="hfield" hfield="flat" pos="0 0 0.29"/>', None),
    ],
)
def test_warning_about_collision_geoms_away_from_the_surface(core: str, gap: float | None) -> None:
    link = LINK.format(f'<geom name="shell" size="0.3" {SEEN}/>{core}')
    model = model_of(link, '<hfield name="flat" nrow="2" ncol="2" size="1 1 0.1 0.1"/>')
    target = Target(contacts=["core"] if "plane" in core or "hfield" in core else None)
    with warnings.catch_warnings(record=True, action="always") as caught:
        Ripples(model, {"shell": target}, resolution=16, backend="cpu")
    told = [
        re.search(r"'shell' collides as 'core'.*up to ([\d.]+) m", str(each.message))
        for each in caught
    ]
    assert [float(each[1]) for each in told] == (
        [] if gap is None else [pytest.approx(gap, rel=0.05)]
    )


def test_warning_about_sdf_geoms_that_fall_through_height_fields() -> None:
    spec = mesh_spec(peanut(0.06), "free", "sdf")
    spec.add_hfield(name="hills", nrow=2, ncol=2, size=[1, 1, 0.1, 0.1], userdata=[0, 1, 1, 0])
    spec.worldbody.add_geom(name="hills", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="hills")
    with pytest.warns(
        RippleWarning, match=r"SDF geom 'target' with height fields \('hills'\).*\"flex\""
    ):
        Ripples(spec.compile(), {"target": Material()}, resolution=8, backend="cpu")
