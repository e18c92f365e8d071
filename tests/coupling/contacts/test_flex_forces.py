"""The load of contacts with a flex collider is the sum of their whole forces, along their mean normal."""

import mujoco
import numpy as np
import pytest
import trimesh
from mujoco_models import mesh_asset

from ripple_sim import make_collidable
from ripple_sim.coupling.contact_reader import ColliderIds
from ripple_sim.coupling.contacts import PairContacts
from ripple_sim.coupling.flex_contacts import FlexContacts, FlexNormals, MujocoFlexContacts, summed_contacts
from ripple_sim.coupling.model import CoupledModel
from ripple_sim.coupling.target_mesh import target_mesh

UP, ASIDE = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
EXTENTS = np.array([0.5, 0.03])


def frame_along(normal: np.ndarray) -> np.ndarray:
    """Rows of a frame: a normal, and two directions across it."""
    x = np.array(normal) / np.linalg.norm(normal)
    y = np.cross(x, [0.6, -0.7, 0.2])
    y /= np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])


def contacts_of(
    *contacts: tuple[tuple[float, ...], tuple[float, float, float]], elem: int = -1, swapped: bool = False
) -> tuple[np.ndarray, MujocoFlexContacts]:
    """Contacts of a ball, geom 1, with a target, geom 0: outward normal, and force on the ball in the world [N]."""
    k, side = len(contacts), int(swapped)
    frames = np.array([frame_along(np.multiply(-1 if swapped else 1, normal)) for normal, _ in contacts]).reshape(k, 9)
    forces = np.array([force for _, force in contacts]).reshape(k, 3) * (-1 if swapped else 1)
    elements = np.full((k, 2), -1, np.int32)
    elements[:, side] = elem
    return np.tile([1, 0] if swapped else [0, 1], (k, 1)), MujocoFlexContacts(
        efc_address=3 * np.arange(k, dtype=np.int32),
        dim=np.full(k, 3, np.int32),
        friction=np.ones((k, 5)),
        elem=elements,
        frame=frames,
        pos=np.arange(3.0 * k).reshape(k, 3),
        dist=np.full(k, -0.002),
        includemargin=np.zeros(k),
        adhesion=np.zeros(k),
        efc_force=np.einsum("kij,kj->ki", frames.reshape(k, 3, 3), forces).ravel(),
        geom_xmat=np.tile(np.eye(3).ravel(), (2, 1)),
    )


def summed(geoms: np.ndarray, contacts: MujocoFlexContacts, normals: np.ndarray | None = None) -> PairContacts:
    flex = FlexNormals(np.array([0, -1]), np.zeros((1, 3)) if normals is None else normals, np.zeros(2, bool))
    return summed_contacts(geoms, contacts, flex, EXTENTS, False)[0]


def test_friction_of_contacts_that_push_sideways_counts_along_the_normal() -> None:
    """Two opposite contacts at a rim cancel along x, but their friction pushes upwards: 3 + 1 + 2 N."""
    found = summed(*contacts_of((UP, (0, 0, 3)), (ASIDE, (50, 0, 1)), ((-1, 0, 0), (-50, 0, 2)), elem=0))
    assert found.forces.sum() != pytest.approx(6), "without the surface's normals all three would count as normals"
    found = summed(
        *contacts_of((UP, (0, 0, 3)), (ASIDE, (50, 0, 1)), ((-1, 0, 0), (-50, 0, 2)), elem=0), np.array([UP])
    )
    np.testing.assert_allclose(found.forces, [6])
    np.testing.assert_array_equal(found.normals, [UP])


def test_the_load_is_shared_by_normal_force_and_by_how_straight_it_is() -> None:
    slanted = (0.6, 0.0, 0.8)
    found = summed(*contacts_of((UP, (0, 0, 4)), (slanted, (1.2, 0, 1.6)), elem=0), np.array([UP]))
    # 4 and 2 N along their own normals; the whole force of (1.2, 0, 5.6) lies along their mean normal as it is
    assert found.forces.sum() == pytest.approx(np.hypot(1.2, 5.6))
    assert found.forces[1] / found.forces[0] == pytest.approx(2 * 0.8**2 / 4)


@pytest.mark.parametrize(
    "contacts",
    [
        [(UP, (0, 0, -2))],
        [(UP, (0, 0, 1)), (ASIDE, (0, 0, -3))],
        [(ASIDE, (5, 0, 0)), ((0, 1, 0), (0, 5, 0))],
        [(UP, (0, 0, 0))],
        [],
    ],
    ids=["pulled", "pulled in sum", "sideways only", "no force", "no contact"],
)
def test_a_pair_that_does_not_push_is_left_out(contacts: list) -> None:
    found = summed(*contacts_of(*contacts, elem=0), np.array([UP]))
    assert len(found.targets) == len(found.forces) == len(found.points) == 0
    assert found.begins.tolist() == found.starts.tolist() == [0]


def test_a_contact_without_a_row_in_the_solver_and_one_with_another_flex_count_nothing() -> None:
    geoms, contacts = contacts_of((UP, (0, 0, 3)), (UP, (0, 0, 5)), (UP, (0, 0, 7)))
    contacts.efc_address[1] = -1
    geoms[2, 1] = -1
    found = summed(geoms, contacts)
    np.testing.assert_allclose(found.forces, [3])


def test_it_does_not_matter_which_of_the_two_mujoco_names_first() -> None:
    contacts = ((UP, (1, 0, 3)), ((0.6, 0, 0.8), (0, 1, 5)), (ASIDE, (4, 0, 2)))
    one = summed(*contacts_of(*contacts, elem=0), np.array([UP]))
    other = summed(*contacts_of(*contacts, elem=0, swapped=True), np.array([UP]))
    for name in ("targets", "others", "begins", "forces", "normals", "points"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-14)


@pytest.mark.parametrize(
    ("dist", "margin", "height"),
    [(-0.002, 0.0, -0.001 + 2 * 0.002), (-0.1, 0.0, -0.05 + 0.1 + 0.03), (0.01, 0.014, 0.005 + 2 * 0.004)],
    ids=["shallow", "deeper than the ball", "within the margin"],
)
def test_points_lie_outside_by_the_depth_but_not_by_more_than_the_geom(
    dist: float, margin: float, height: float
) -> None:
    """MuJoCo's point is half-way between the two surfaces; of the ball's, it is out by its depth in the margin twice.

    The ball's smallest half-extent is 0.03 m.
    """
    geoms, contacts = contacts_of((UP, (0, 0, 3)))
    contacts.dist[:], contacts.includemargin[:] = dist, margin
    [point] = summed(geoms, contacts).points
    assert point[2] - contacts.pos[0, 2] == pytest.approx(height)


def test_normals_turn_with_the_geom() -> None:
    geoms, contacts = contacts_of((UP, (0, 0, 3)), elem=0)
    contacts.geom_xmat[0] = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]).T.ravel()
    local = contacts.geom_xmat[0].reshape(3, 3).T @ UP
    np.testing.assert_allclose(summed(geoms, contacts, local[None]).normals, [UP], atol=1e-15)


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
    reader = FlexContacts(coupled, {0: target_mesh(model, 0)})
    data.qvel[:] = [0.4, 0.2, -1.0, 4.0, 2.0, 5.0]
    for _ in range(100):
        mujoco.mj_step(model, data)
        found = reader.contacts(data, ColliderIds(coupled)(data), coupled.extents)
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
        ([(UP, (0, 0, 4)), (ASIDE, (12, 0, 0))], np.hypot(12, 4) - np.hypot(4, 4)),
        # nothing pushes along the surface's normal
        ([(ASIDE, (5, 0, 0))], 5.0),
    ],
)
def test_pushes_sideways_beyond_friction_are_told(contacts: list, unexplained: float) -> None:
    flex = FlexNormals(np.array([0, -1]), np.array([UP]), np.zeros(2, bool))
    _, amounts = summed_contacts(*contacts_of(*contacts, elem=0), flex, EXTENTS, False)
    whole = np.linalg.norm(sum(np.array(force, dtype=float) for _, force in contacts))
    np.testing.assert_allclose(amounts, [[whole, unexplained], [0, 0]], atol=1e-12)
