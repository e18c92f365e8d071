"""The load on a target has the impulse and the place of its contacts, and is reported."""

import dataclasses
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
from hits import Run

from ripple_sim import Material, Ripples
from ripple_sim.coupling import Contacts, Impulse, StepContacts, TargetLoad
from ripple_sim.solver import WaveSolver, sphere_atlas

DT = 0.002
POLE = (0, 0, 1)
SIDE = (1, 0, 0)
CORNER = (1, 0.8, -0.7)
RADII = np.array([1.0, 0.1, 0.1, 0.1])
CONVEX = np.ones(4, dtype=bool)
NAMES = ["globe", "one", "two", "three"]

# points of the unit sphere, and forces [N], by geom
TWO_GEOMS = {1: [((0, 0, 1), 5.0)], 3: [((1, 0, 0.1), 2.0), ((1, 0.2, 0), 1.0)]}


class Pose(NamedTuple):
    """Of a sphere of 1 m, geom 0, that has been moved and turned."""

    position: np.ndarray
    rotation: np.ndarray


def tilted() -> Pose:
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, np.array([0.8, 0.0, 0.36, 0.48]))
    return Pose(np.array([3.0, -2.0, 5.0]), rotation.reshape(3, 3))


def sphere_load(**material: object) -> TargetLoad:
    waves = WaveSolver(sphere_atlas(1.0, 16), Material(**material), backend="cpu")
    return TargetLoad(waves, 0, RADII, CONVEX)


def contacts_on(pose: Pose, contacts: dict[int, list[tuple[np.ndarray, float]]]) -> Contacts:
    """Contacts by geom: points of the unit sphere in its own frame, and normal forces [N]."""
    others = []
    normals = []
    forces = []
    for geom, of_geom in contacts.items():
        for normal, force in of_geom:
            others.append(geom)
            normals.append(normal / np.linalg.norm(normal))
            forces.append(force)
    world_normals = np.array(normals, np.float64) @ pose.rotation.T
    return Contacts(
        others=np.array(others),
        points=pose.position + 1.003 * world_normals,  # MuJoCo's contacts are off the surface
        forces=np.array(forces, np.float64),
        normals=world_normals,
    )


def given_until_over(load: TargetLoad) -> float:
    """Impulse that is still given after the geoms have left [N s]."""
    total = 0.0
    for _ in range(5000):
        present = load.over(DT)
        if not len(present.forces):
            return total
        total += present.forces.sum() * DT
    raise AssertionError("the load does not end")


@pytest.mark.parametrize("elapsed", [DT, 3 * DT, DT / 2])
def test_a_step_gives_the_whole_impulse_of_its_contacts_for_any_elapsed_time(
    elapsed: float,
) -> None:
    pose = tilted()
    contacts = contacts_on(pose, {1: [(POLE, 5.0)], 3: [(SIDE, 2.0), (CORNER, 1.0)]})
    load, _ = sphere_load().touched(contacts, pose, DT, elapsed)
    assert load.forces.sum() * elapsed == pytest.approx(8.0 * DT, rel=1e-9)
    assert (load.forces >= 0).all()


@pytest.mark.parametrize("steps", [3, 40, 400])
def test_the_whole_impulse_has_been_given_when_all_geoms_have_left(steps: int) -> None:
    rng = np.random.default_rng(steps)
    pose = tilted()
    load = sphere_load()
    pushed = given = 0.0
    for _ in range(steps):
        forces = rng.exponential(3.0, 2)
        present, _ = load.touched(
            contacts_on(pose, {1: [(POLE, forces[0])], 2: [(SIDE, forces[1])]}), pose, DT, DT
        )
        pushed = pushed + forces.sum() * DT
        given = given + present.forces.sum() * DT
    assert given + given_until_over(load) == pytest.approx(pushed, rel=1e-9)


def test_new_waves_on_the_same_atlas_get_the_outstanding_load() -> None:
    """After a rest with chatter there is a deficit; it survives a change of the material."""
    pose = tilted()
    kept = sphere_load()
    changed = sphere_load()
    for step in range(301):
        for load in (kept, changed):
            if step % 3:
                load.touched(contacts_on(pose, {1: [(POLE, 3.0)]}), pose, DT, DT)
            else:
                load.over(DT)
    changed.set_waves(WaveSolver(sphere_atlas(1.0, 16), Material(speed=3.0), backend="cpu"))
    deficit = given_until_over(kept)
    assert abs(deficit) > 1e-4
    assert given_until_over(changed) == pytest.approx(deficit, rel=1e-12)


def test_forces_on_fixed_texels_are_lost() -> None:
    """Footprints made for the old waves must not serve the new ones."""
    atlas = sphere_atlas(1.0, 16)
    pose = tilted()
    load = TargetLoad(WaveSolver(atlas, Material(), backend="cpu"), 0, RADII, CONVEX)
    both = contacts_on(pose, {1: [(POLE, 5.0)], 2: [((0, 0, -1), 7.0)]})
    before, _ = load.touched(both, pose, DT, DT)
    load.set_waves(WaveSolver(atlas, Material(fixed=atlas.positions[..., 2] < 0), backend="cpu"))
    after, _ = load.touched(both, pose, DT, DT)
    assert before.forces.sum() == pytest.approx(12.0)
    assert after.forces.sum() == pytest.approx(5.0)


def local_to(pose: Pose, point: np.ndarray) -> np.ndarray:
    return (point - pose.position) @ pose.rotation


def record_of(contacts: dict = TWO_GEOMS, elapsed: float = DT) -> tuple[StepContacts, Pose]:
    pose = tilted()
    _, record = sphere_load().touched(contacts_on(pose, contacts), pose, DT, elapsed)
    return record, pose


def impulses_of(record: StepContacts) -> list[Impulse]:
    owners = np.arange(len(NAMES))
    return list(record.impulses(NAMES, owners, sphere_atlas(1.0, 16), DT))


@pytest.mark.parametrize("elapsed", [DT, 4 * DT])
def test_each_geom_has_one_impulse_for_any_spread_of_its_load_over_time(
    elapsed: float,
) -> None:
    record, _ = record_of(elapsed=elapsed)
    impulses = impulses_of(record)
    assert [(each.geom, each.other) for each in impulses] == [("globe", "one"), ("globe", "three")]
    assert [each.impulse for each in impulses] == pytest.approx([5.0 * DT, 3.0 * DT])


def test_the_point_lies_within_the_texel() -> None:
    directions = np.random.default_rng(0).standard_normal((30, 3))
    atlas = sphere_atlas(1.0, 16)
    for direction in directions:
        record, pose = record_of({2: [(direction, 1.0)]})
        [impulse] = impulses_of(record)
        away = np.linalg.norm(atlas.positions[impulse.texel] - local_to(pose, impulse.point))
        # at the cube's corners texels are rhombi of 120 degrees: half the diagonal is 0.93 of the
        # area's root
        assert away < 0.95 * np.sqrt(atlas.areas[impulse.texel])


def test_impulses_on_one_flex_are_reported_as_one_at_their_mean_point() -> None:
    record, pose = record_of()
    names = ["globe", "cloth"]
    owners = np.array([0, 1, 1, 1])
    [impulse] = record.impulses(names, owners, sphere_atlas(1.0, 16), DT)
    assert (impulse.geom, impulse.other) == ("globe", "cloth")
    assert impulse.impulse == pytest.approx(8.0 * DT)
    local = local_to(pose, impulse.point)
    places = [local_to(pose, each.point) for each in impulses_of(record)]
    middle = np.average(places, axis=0, weights=[5.0, 3.0])
    np.testing.assert_allclose(local, middle / np.linalg.norm(middle), atol=2e-3)


def test_the_load_of_a_target_does_not_depend_on_other_targets() -> None:
    """Targets with bodies on them have the same waves alone and together, bit for bit."""
    rng = np.random.default_rng(4)
    target = '<geom name="{}" type="box" size="0.3 0.3 0.05" pos="{} 0 0"/>'
    names = ("left", "middle", "right")
    targets = "".join(
        target.format(name, x) for name, x in zip(names, (-0.7, 0.0, 0.7), strict=True)
    )
    bodies = "".join(
        f'<body pos="{0.7 * (i % 3 - 1) + x:.3f} {y:.3f} {0.1 + 0.02 * i:.3f}"><freejoint/>'
        f'<geom type="{("sphere", "box", "capsule")[i // 3]}" size="0.04 0.04 0.04"/></body>'
        for i, (x, y) in enumerate(rng.uniform(-0.2, 0.2, (9, 2)))
    )
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{targets}{bodies}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    options = {"resolution": 16, "backend": "cpu"}
    together = Ripples(model, {name: Material() for name in names}, **options)
    alone = {name: Ripples(model, {name: Material()}, **options) for name in names}
    most = 0
    for _ in range(200):
        mujoco.mj_step(model, data)
        together.step(data)
        for ripples in alone.values():
            ripples.step(data)
        one_by_one = [each for ripples in alone.values() for each in ripples.last_impulses]
        expected = [(each.geom, each.other) for each in one_by_one]
        assert [(each.geom, each.other) for each in together.last_impulses] == expected
        most = max(most, len(together.last_impulses))
    assert most > 6
    for name in names:
        assert together[name].height.any()
        np.testing.assert_array_equal(together[name].height, alone[name][name].height)


GROOVE = """<mujoco><option timestep="0.001"/><asset>
<mesh name="groove" vertex="-.3 -.4 -.1  .3 -.4 -.1  .3 -.4 .3  0 -.4 0  -.3 -.4 .3
  -.3 .4 -.1  .3 .4 -.1  .3 .4 .3  0 .4 0  -.3 .4 .3"
  face="0 1 3  1 2 3  0 3 4
  5 8 6  6 8 7  5 9 8  0 5 6  0 6 1  1 6 7  1 7 2  2 7 8  2 8 3  3 8 9  3 9 4  4 9 5  4 5 0"/>
<mesh name="left"
  vertex="-.3 -.4 -.1  0 -.4 -.1  0 -.4 0  -.3 -.4 .3  -.3 .4 -.1  0 .4 -.1  0 .4 0  -.3 .4 .3"/>
<mesh name="right"
  vertex=".3 -.4 -.1  0 -.4 -.1  0 -.4 0  .3 -.4 .3  .3 .4 -.1  0 .4 -.1  0 .4 0  .3 .4 .3"/>
</asset><default><geom condim="1"/></default><worldbody><body>
<geom name="groove" type="mesh" mesh="groove" contype="0" conaffinity="0"/>
<geom name="left" type="mesh" mesh="left" group="3"/>
<geom name="right" type="mesh" mesh="right" group="3"/></body>
<body pos="0 0 {height}"><freejoint/><geom name="ball" size="0.16" mass="1"/></body></worldbody>
</mujoco>"""


def test_impulses_of_a_wedged_ball_are_reported_where_it_touches() -> None:
    """The middle of its contacts lies in the air between the two walls."""
    model = mujoco.MjModel.from_xml_string(GROOVE.format(height=0.16 * np.sqrt(2) + 1e-3))
    run = Run(model, "groove", density=10, resolution=16, contacts=["left", "right"])
    wedged = 0
    for _ in range(200):
        hits = run.step()
        contact = run.data.contact
        if run.data.ncon == 2 and len(hits) == 2:
            wedged += 1
            places = sorted(hits, key=lambda hit: hit.point[0])
            at = contact.pos[np.argsort(contact.pos[:, 0])]
            assert (
                max(np.linalg.norm(hit.point - each) for hit, each in zip(places, at, strict=True))
                < 0.01
            )
        else:
            assert run.data.ncon < 2
    assert wedged > 100
    gained = run.data.qvel[2] + 9.81 * run.data.time
    assert run.given() * np.sqrt(0.5) == pytest.approx(gained, rel=1e-3)


def test_impulses_are_equal_where_all_their_values_are() -> None:
    values = {"geom": "block", "other": "ball", "impulse": 0.25, "texel": (2, 0, 1), "inner": False}
    impulse = Impulse(point=np.array([0.1, -0.0, 3.0]), **values)
    same = Impulse(point=np.array([0.1, 0.0, 3.0]), **values)
    assert impulse == same and hash(impulse) == hash(same) and len({impulse, same}) == 1
    others = {"geom": "floor", "other": "box", "impulse": 0.5, "texel": (2, 0, 2), "inner": True}
    for name, value in [*others.items(), ("point", np.array([0.1, 0.0, 3.1]))]:
        assert dataclasses.replace(impulse, **{name: value}) != impulse
    assert impulse != values
