"""MuJoCo's contacts by target and geom: none is lost, doubled or turned round."""

import mujoco
import numpy as np
import pytest
import trimesh
from hits import Run
from mujoco_models import BALL, mesh_asset, model_of

from ripple_sim import make_collidable
from ripple_sim.coupling import ContactReader, Contacts, CoupledModel, first_rows, target_atlas

SHAPES = (
    'type="box" size="0.2 0.2 0.1"',
    'type="sphere" size="0.15"',
    'type="capsule" size="0.08 0.1"',
)


def pit(seed: int, cone: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Bodies of three shapes that have fallen into a pit, with contacts of several dimensions."""
    rng = np.random.default_rng(seed)
    wall = '<geom type="plane" size="3 3 0.1" pos="{0} {1} 0" zaxis="{2} {3} {4}"/>'
    ways = (0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)
    walls = "".join(wall.format(-0.35 * x, -0.35 * y, x, y, z) for x, y, z in ways)
    bodies = "".join(
        f'<body pos="{x:.3f} {y:.3f} {0.2 + 0.25 * i:.3f}"><freejoint/>'
        f'<geom {SHAPES[i % 3]} condim="{(1, 3, 4, 6)[i % 4]}"/></body>'
        for i, (x, y) in enumerate(rng.uniform(-0.1, 0.1, (8, 2)))
    )
    option = f'<option timestep="0.002" cone="{cone}"/>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco>{option}<worldbody>{walls}{bodies}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=400)
    return model, data


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("seed", range(3))
def test_every_contact_with_a_force_is_found_once_for_each_target_it_touches(
    cone: str, seed: int
) -> None:
    model, data = pit(seed, cone)
    is_target = np.zeros(model.ngeom, dtype=bool)
    is_target[[5, 6, 8, 9, 11]] = True
    found = reader_of(model, *np.flatnonzero(is_target).tolist()).read(data)
    expected: dict[int, dict[int, list[tuple[float, np.ndarray, np.ndarray]]]] = {}
    for i, contact in enumerate(data.contact):
        wrench = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, wrench)
        for target, other, sign in ((*contact.geom, 1.0), (*contact.geom[::-1], -1.0)):
            if is_target[target] and wrench[0] > 0:
                of_target = expected.setdefault(int(target), {})
                of_target.setdefault(int(other), []).append(
                    (wrench[0], sign * contact.frame[:3], contact.pos)
                )
    assert list(found) == sorted(expected), "targets stand in ascending order"
    assert sum(len(others) for others in expected.values()) > 6
    for target, others in expected.items():
        here = found[target].others
        assert here[first_rows(here)].tolist() == sorted(others), "so do the geoms that touch one"
        for other in others:
            _, points, forces, normals = found[target].rows(here == other)
            force, normal, place = (np.array(each) for each in zip(*others[other], strict=True))
            np.testing.assert_allclose(forces, force, rtol=1e-12)
            np.testing.assert_array_equal(normals, normal)
            outside = np.einsum("ij,ij->i", points - place, normal)
            assert (outside >= 0).all(), "points lie outside of the target's surface"
            np.testing.assert_allclose(points - place, outside[:, None] * normal, atol=1e-15)


def test_a_speculative_contact_loads_the_target_in_place() -> None:
    """MuJoCo's speculative contacts have overlaps of metres, which must not move their points."""
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0.1 0 0.53"))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    reader = reader_of(model, "target")
    [before] = reader.read(data).values()
    data.contact.dist[:] = -7.0
    [after] = reader.read(data).values()
    np.testing.assert_array_equal(after.forces, before.forces)
    assert np.linalg.norm(after.points - before.points) < 1.5 * 0.05


PLANK = """<body name="plank" pos="0.3 0 0.232"><freejoint/>
<geom name="plank" type="box" size="0.3 0.1 0.03" mass="2"/></body>"""


def slab_and_table(bodies: str, slab: str = "") -> mujoco.MjModel:
    """A slab that collides through a flex, and a table beside it, both with their tops at 0.2 m."""
    solid = trimesh.creation.box(extents=(0.6, 0.6, 0.4))
    V, F = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, 0.12)
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><default><geom condim="1"/></default><asset>{mesh_asset("m", V, F)}</asset>
        <worldbody>
        <geom name="table" type="box" size="0.3 0.3 0.2" pos="0.6 0 0"/>
        <body name="slab" {slab}>{"<freejoint/>" if slab else ""}
        <geom name="slab" type="mesh" mesh="m" mass="3"/></body>{bodies}</worldbody></mujoco>"""
    )
    make_collidable(spec, "slab", "flex")
    return spec.compile()


def reader_of(model: mujoco.MjModel, *targets: str | int) -> ContactReader:
    geoms = [model.geom(name).id for name in targets]
    return ContactReader(
        CoupledModel(model), {geom: target_atlas(model, geom, 8) for geom in geoms}
    )


def after(model: mujoco.MjModel, steps: int) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=steps)
    return data


def push_on_target(contacts: Contacts) -> np.ndarray:
    return -contacts.forces @ contacts.normals


def test_a_body_at_rest_on_a_flex_and_a_geom_presses_with_its_weight() -> None:
    model = slab_and_table(PLANK)
    slab, table, plank = (model.geom(name).id for name in ("slab", "table", "plank"))
    reader = reader_of(model, "slab", "table")
    data = after(model, 600)
    push = np.zeros(3)
    found = reader.read(data)
    assert sorted(found) == sorted((slab, table))
    for contacts in found.values():
        assert set(contacts.others.tolist()) == {plank}
        np.testing.assert_allclose(contacts.points[:, 2], 0.2, atol=0.01)
        assert push_on_target(contacts)[2] < -1
        push += push_on_target(contacts)
    np.testing.assert_allclose(push, [0, 0, -2 * 9.81], atol=0.02)


def test_contacts_of_a_flex_collider_that_does_not_ripple_count_for_its_geom() -> None:
    model = slab_and_table("", slab='pos="0.6 0 0.41"')
    [(target, contacts)] = reader_of(model, "table").read(after(model, 600)).items()
    assert (target, set(contacts.others.tolist())) == (
        model.geom("table").id,
        {model.geom("slab").id},
    )
    np.testing.assert_allclose(push_on_target(contacts), [0, 0, -3 * 9.81], atol=0.05)


SECONDS = 0.4
WEIGHT = 9.81


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("sticky", ["geom", "actuator", "both"])
@pytest.mark.parametrize("side", [1, -1], ids=["above", "below"])
def test_a_sticky_ball_gives_the_target_its_weight_and_no_more(
    cone: str, sticky: str, side: int
) -> None:
    adhesion = 'adhesion="20"' if sticky != "actuator" else ""
    actuator = '<adhesion body="ball" ctrlrange="0 1" gain="30"/>' if sticky != "geom" else ""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.001" cone="{cone}"/><worldbody>
        <geom name="target" size="0.5"/>
        <body name="ball" pos="0 0 {side * 0.55}"><freejoint/>
        <geom name="ball" size="0.05" mass="1" gap="0.01" {adhesion}/></body></worldbody>
        <actuator>{actuator}</actuator></mujoco>"""
    )
    run = Run(model, "target", resolution=8)
    run.data.ctrl[:] = 1.0
    given = run.until(SECONDS).given()
    assert abs(run.data.body("ball").xpos[2]) == pytest.approx(0.55, abs=2e-3), (
        "the ball stays where it is"
    )
    lost = (run.data.qvel[2] + WEIGHT * SECONDS) * model.body("ball").mass[0]
    assert given == pytest.approx(side * WEIGHT * SECONDS, rel=0.01)
    assert given == pytest.approx(side * abs(lost), rel=1e-3)
    # a share of the first moments may still be on its way
    assert run.ripples["target"].momentum() == pytest.approx(-given, rel=0.02)


def test_two_suckers_on_one_body_share_the_force_among_their_contacts() -> None:
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.001"/><worldbody>
        <geom name="target" type="box" size="0.5 0.5 0.1"/>
        <body name="plate" pos="0 0 -0.15"><freejoint/><geom size="0.05" pos="-0.2 0 0" mass="1"/>
        <geom size="0.05" pos="0.2 0 0" mass="1"/></body></worldbody>
        <actuator><adhesion body="plate" ctrlrange="0 1" gain="60"/></actuator></mujoco>"""
    )
    run = Run(model, "target", resolution=8)
    run.data.ctrl[:] = 1.0
    run.until(0.2)
    assert [hit.impulse for hit in run.hits[-1]] == pytest.approx([-WEIGHT * 0.001] * 2, rel=0.01)
