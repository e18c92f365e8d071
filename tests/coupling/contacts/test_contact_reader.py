"""Contacts with geoms and with flex colliders are read together: each once, and for all targets."""

import mujoco
import numpy as np
import pytest
import trimesh
from mujoco_models import BALL, mesh_asset, model_of

from ripple_sim import make_collidable
from ripple_sim.coupling.contact_reader import ContactReader
from ripple_sim.coupling.contacts import TargetContacts, geom_contacts
from ripple_sim.coupling.model import CoupledModel
from ripple_sim.coupling.target_mesh import target_atlas

PLANK = """<body name="plank" pos="0.3 0 0.232"><freejoint/>
<geom name="plank" type="box" size="0.3 0.1 0.03" mass="2"/></body>"""


def slab_and_table(bodies: str, slab: str = "") -> mujoco.MjModel:
    """A slab that collides through a flex, and a table beside it, both with their tops at 0.2 m."""
    solid = trimesh.creation.box(extents=(0.6, 0.6, 0.4))
    V, F = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, 0.12)
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco><default><geom condim="1"/></default><asset>{mesh_asset("m", V, F)}</asset><worldbody>
        <geom name="table" type="box" size="0.3 0.3 0.2" pos="0.6 0 0"/>
        <body name="slab" {slab}>{"<freejoint/>" if slab else ""}
        <geom name="slab" type="mesh" mesh="m" mass="3"/></body>{bodies}</worldbody></mujoco>"""
    )
    make_collidable(spec, "slab", "flex")
    return spec.compile()


def reader_of(model: mujoco.MjModel, *targets: str) -> ContactReader:
    geoms = [model.geom(name).id for name in targets]
    return ContactReader(CoupledModel(model), {geom: target_atlas(model, geom, 8) for geom in geoms})


def after(model: mujoco.MjModel, steps: int) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=steps)
    return data


def push_on_target(contacts: TargetContacts) -> np.ndarray:
    return -contacts.forces[slice(*contacts.begins[[0, -1]])] @ contacts.normals[slice(*contacts.begins[[0, -1]])]


def test_a_body_at_rest_on_a_flex_and_a_geom_weighs_on_both_what_it_weighs() -> None:
    model = slab_and_table(PLANK)
    slab, table, plank = (model.geom(name).id for name in ("slab", "table", "plank"))
    reader, data, push = reader_of(model, "slab", "table"), after(model, 600), np.zeros(3)
    found = reader.read(data)
    assert sorted(found) == sorted((slab, table))
    for geom, contacts in found.items():
        assert contacts.target == geom
        assert contacts.others.tolist() == [plank]
        np.testing.assert_allclose(contacts.points[:, 2], 0.2, atol=0.01)
        assert push_on_target(contacts)[2] < -1
        push += push_on_target(contacts)
    np.testing.assert_allclose(push, [0, 0, -2 * 9.81], atol=0.02)


def test_only_targets_are_read_and_only_those_that_are_touched() -> None:
    model = slab_and_table(PLANK)
    slab, table = model.geom("slab").id, model.geom("table").id
    resting, flying = after(model, 100), mujoco.MjData(model)
    flying.qpos[2] = 5
    mujoco.mj_forward(model, flying)
    both = reader_of(model, "slab", "table").read(resting)
    for name, geom in (("slab", slab), ("table", table)):
        found = reader_of(model, name).read(resting)
        assert list(found) == [geom]
        np.testing.assert_allclose(push_on_target(found[geom]), push_on_target(both[geom]), rtol=1e-12)
        assert not reader_of(model, name).read(flying)
    assert not reader_of(model).read(resting)


def test_two_targets_push_on_each_other_with_the_same_force() -> None:
    """A free slab with a flex lies on the table: without friction, sum of whole forces and of normal ones agree."""
    model = slab_and_table("", slab='pos="0.6 0 0.41"')
    slab, table = model.geom("slab").id, model.geom("table").id
    data = after(model, 600)
    found = reader_of(model, "slab", "table").read(data)
    assert found[slab].others.tolist() == [table]
    assert found[table].others.tolist() == [slab]
    np.testing.assert_allclose(push_on_target(found[table]), -push_on_target(found[slab]), atol=0.05)
    np.testing.assert_allclose(push_on_target(found[table]), [0, 0, -3 * 9.81], atol=0.05)


def test_a_flex_that_does_not_ripple_goes_by_its_geom() -> None:
    model = slab_and_table("", slab='pos="0.6 0 0.41"')
    [(target, contacts)] = reader_of(model, "table").read(after(model, 600)).items()
    assert (target, contacts.others.tolist()) == (model.geom("table").id, [model.geom("slab").id])


def test_without_flexes_the_contacts_are_those_of_geoms() -> None:
    model = model_of('<geom name="target" type="box" size="0.5 0.5 0.5"/>' + BALL.format("0.1 0 0.53"))
    data = after(model, 1)
    ids = data.contact.geom.astype(int)
    [found], [expected] = (
        reader_of(model, "target").read(data).values(),
        geom_contacts(model, data, ids, np.array([True, False]), CoupledModel(model).extents).values(),
    )
    wrench = np.zeros(6)
    mujoco.mj_contactForce(model, data, 0, wrench)
    assert found.forces.tolist() == [pytest.approx(wrench[0])]
    for mine, theirs in zip(found, expected, strict=True):
        np.testing.assert_array_equal(mine, theirs)
