"""Contacts by target and geom: none is lost, doubled or turned round, against MuJoCo's own list.

MuJoCo's contacts, grouped by target and geom, against a search through all of them.
"""

import mujoco
import numpy as np
import pytest
from mujoco_models import BALL, model_of

from ripple_sim.coupling.contacts import TargetContacts, geom_contacts, group_by_pair
from ripple_sim.coupling.model import CoupledModel

SHAPES = ('type="box" size="0.2 0.2 0.1"', 'type="sphere" size="0.15"', 'type="capsule" size="0.08 0.1"')


def pit(seed: int, cone: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Bodies of three shapes that have fallen into a pit, with contacts of several dimensions."""
    rng = np.random.default_rng(seed)
    walls = "".join(
        f'<geom type="plane" size="3 3 0.1" pos="{-0.35 * x} {-0.35 * y} 0" zaxis="{x} {y} {z}"/>'
        for x, y, z in ((0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))
    )
    bodies = "".join(
        f'<body pos="{x:.3f} {y:.3f} {0.2 + 0.25 * i:.3f}"><freejoint/>'
        f'<geom {SHAPES[i % 3]} condim="{(1, 3, 4, 6)[i % 4]}"/></body>'
        for i, (x, y) in enumerate(rng.uniform(-0.1, 0.1, (8, 2)))
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="0.002" cone="{cone}"/><worldbody>{walls}{bodies}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=400)
    return model, data


def by_geom(contacts: TargetContacts) -> dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    rows = [slice(a, b) for a, b in zip(contacts.begins[:-1], contacts.begins[1:], strict=True)]
    return {
        other: (contacts.points[row], contacts.forces[row], contacts.normals[row])
        for other, row in zip(contacts.others.tolist(), rows, strict=True)
    }


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("seed", range(3))
def test_every_contact_with_a_force_is_found_once_for_each_target_it_touches(cone: str, seed: int) -> None:
    model, data = pit(seed, cone)
    is_target = np.zeros(model.ngeom, dtype=bool)
    is_target[[5, 6, 8, 9, 11]] = True
    found = geom_contacts(model, data, data.contact.geom.astype(int), is_target, CoupledModel(model).extents)
    expected: dict[int, dict[int, list[tuple[float, np.ndarray, np.ndarray]]]] = {}
    for i, contact in enumerate(data.contact):
        wrench = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, wrench)
        for target, other, sign in ((*contact.geom, 1.0), (*contact.geom[::-1], -1.0)):
            if is_target[target] and wrench[0] > 0:
                of_target = expected.setdefault(int(target), {})
                of_target.setdefault(int(other), []).append((wrench[0], sign * contact.frame[:3], contact.pos))
    assert list(found) == sorted(expected), "targets stand in ascending order"
    assert sum(len(others) for others in expected.values()) > 6
    for target, others in expected.items():
        contacts = by_geom(found[target])
        assert found[target].target == target
        assert list(contacts) == sorted(others), "so do the geoms that touch one"
        for other, (points, forces, normals) in contacts.items():
            force, normal, place = (np.array(each) for each in zip(*others[other], strict=True))
            np.testing.assert_allclose(forces, force, rtol=1e-12)
            np.testing.assert_array_equal(normals, normal)
            outside = np.einsum("ij,ij->i", points - place, normal)
            assert (outside >= 0).all(), "points lie outside of the target's surface"
            np.testing.assert_allclose(points - place, outside[:, None] * normal, atol=1e-15)


def test_what_touches_no_target_is_left_out() -> None:
    model, data = pit(0, "pyramidal")
    extents = CoupledModel(model).extents
    assert data.ncon > 0
    assert not geom_contacts(model, data, data.contact.geom.astype(int), np.zeros(model.ngeom, dtype=bool), extents)
    data.contact.efc_address[:] = -1
    assert not geom_contacts(model, data, data.contact.geom.astype(int), np.ones(model.ngeom, dtype=bool), extents)


def test_speculative_contact_loads_the_target_where_it_is() -> None:
    """MuJoCo's speculative contacts have a made-up overlap of metres, which must not carry their points away."""
    model = model_of('<geom name="target" type="sphere" size="0.5"/>' + BALL.format("0.1 0 0.53"))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    is_target, extents = np.array([True, False]), CoupledModel(model).extents
    [before] = geom_contacts(model, data, data.contact.geom.astype(int), is_target, extents).values()
    data.contact.dist[:] = -7.0
    [after] = geom_contacts(model, data, data.contact.geom.astype(int), is_target, extents).values()
    np.testing.assert_array_equal(after.forces, before.forces)
    assert np.linalg.norm(after.points - before.points) < 1.5 * 0.05


@pytest.mark.parametrize("seed", range(5))
def test_groups_hold_every_contact_of_a_target_once_and_in_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    geoms = np.array([rng.choice(6, 2, replace=False) for _ in range(60)])
    address, is_target = rng.integers(-1, 3, 60), rng.random(6) < 0.5
    expected: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for i, pair in enumerate(geoms.tolist()):
        for side in range(2):
            target, other = pair[side], pair[1 - side]
            if address[i] >= 0 and is_target[target]:
                expected.setdefault((target, other), []).append((i, side))
    pairs = group_by_pair(geoms, address, is_target)
    found = list(zip(pairs.targets.tolist(), pairs.others.tolist(), strict=True))
    assert found == sorted(expected)
    for i, pair in enumerate(found):
        rows = slice(*pairs.begins[i : i + 2])
        assert list(zip(pairs.contacts[rows].tolist(), pairs.sides[rows].tolist(), strict=True)) == expected[pair]


def test_nothing_to_group() -> None:
    pairs = group_by_pair(np.zeros((0, 2), np.int64), np.zeros(0, np.int64), np.ones(3, bool))
    assert [len(each) for each in pairs] == [0, 0, 1, 0, 0]
