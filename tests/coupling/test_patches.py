"""Contacts mark the corners of a patch: the force is spread over it, and force and torque stay the same.

Contacts near each other are joined; their forces and their force-weighted middle stay.

The packed patches of all geoms on a target are those of each geom alone.

Points taken into a geom's frame and back agree with MuJoCo's own transforms.
"""

import mujoco
import numpy as np
import pytest

from ripple_sim.coupling.contacts import TargetContacts
from ripple_sim.coupling.patches import (
    MAX_CLUSTERS,
    Pose,
    cluster,
    find_load_points,
    find_patches,
    find_probes,
    in_frame,
    in_world,
    spread,
)
from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas

SQUARE = 0.1 * np.array([[-1, -1, 5], [1, -1, 5], [-1, 1, 5], [1, 1, 5]])


def spread_patch(
    atlas: Atlas, points: np.ndarray, forces: np.ndarray, radius: float, convex: bool
) -> tuple[np.ndarray, np.ndarray, float]:
    loads, probes = find_probes(points, forces, radius, convex)
    at, spread_forces, greater, rows = spread(loads, probes, atlas.project(probes)[0], radius)
    if rows[0] >= 0:
        np.testing.assert_array_equal(probes[rows], at)
    return at, spread_forces, greater


def test_four_equal_corners_spread_evenly_over_the_square(block: Atlas) -> None:
    points, forces, radius = spread_patch(block, SQUARE, np.full(4, 2.5), 0.01, convex=True)
    # nodes of a 3 x 3 lattice, each with the area that it stands for: 1 at a corner, 2 at a rim, 4 in the middle
    assert sorted(np.round(forces / 10 * 16)) == [1, 1, 1, 1, 2, 2, 2, 2, 4]
    assert np.abs(points[:, :2]).max() < 0.1
    assert radius > 0.05


@pytest.mark.parametrize("seed", range(4))
def test_force_and_torque_stay_what_they_are(block: Atlas, seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = np.column_stack([rng.uniform(-0.3, 0.3, (6, 2)), np.full(6, 0.5)])
    loads = rng.uniform(0.1, 3.0, 6)
    points, forces, _ = spread_patch(block, corners, loads, 0.01, convex=True)
    assert len(forces) > 6
    assert forces.sum() == pytest.approx(loads.sum(), rel=1e-12)
    np.testing.assert_allclose(forces @ points, loads @ corners, atol=1e-12)


def test_number_of_points_is_bounded_however_many_contacts_there_are(block: Atlas) -> None:
    rng = np.random.default_rng(5)
    corners = np.column_stack([rng.uniform(-0.4, 0.4, (200, 2)), np.full(200, 0.5)])
    loads = rng.uniform(0.1, 1.0, 200)
    points, forces, _ = spread_patch(block, corners, loads, 0.001, convex=True)
    assert len(forces) <= MAX_CLUSTERS * (MAX_CLUSTERS + 1) // 2
    np.testing.assert_allclose(forces @ points, loads @ corners)


def test_no_force_where_the_surface_is_not(block: Atlas) -> None:
    """Two contacts on the head and on the rump of an animal load it there, and not on the saddle between them."""
    V, F = limbed(0.05)
    animal = build_atlas(Mesh.from_arrays(V, F), 16, cache=False)
    head, rump = V[V[:, 2].argmax()], V[V[:, 0].argmin()]
    loads = np.array([2.0, 1.0])
    points, forces, radius = spread_patch(animal, np.array([head, rump]), loads, 0.02, convex=True)
    np.testing.assert_array_equal(points, [head, rump])
    np.testing.assert_allclose(forces, loads)
    assert radius == 0.02


def test_geoms_that_are_not_convex_load_the_surface_at_their_contacts(block: Atlas) -> None:
    points, _, radius = spread_patch(block, SQUARE, np.ones(4), 0.01, convex=False)
    assert len(points) == 4
    assert radius == 0.01


def test_far_contacts_of_one_pair_stay_apart_and_add_up() -> None:
    points = np.array([[0, 0, 0], [0.01, 0, 0], [1.0, 0, 0]])
    forces = np.array([1.0, 3.0, 2.0])
    middles, totals = cluster(points, forces, 0.05)
    np.testing.assert_allclose(totals, [4.0, 2.0])
    np.testing.assert_allclose(middles, [[0.0075, 0, 0], [1, 0, 0]])


def test_number_of_clusters_is_bounded_however_many_contacts_there_are() -> None:
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-0.4, 0.4, (200, 2)), np.full(200, 0.5)])
    forces = rng.uniform(0.1, 1.0, 200)
    middles, totals = cluster(points, forces, 0.001)
    assert len(totals) == MAX_CLUSTERS
    np.testing.assert_allclose(totals @ middles, forces @ points)


RADII, CONVEX = np.array([0.5, 0.04, 0.06, 0.03, 0.05]), np.array([True, True, False, True, True])


def random_contacts(seed: int) -> tuple[TargetContacts, np.ndarray, np.ndarray]:
    """Contacts of four geoms with the upper side of a cube, which stands somewhere in the world."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 6, 4)
    counts[rng.integers(4)] = 1
    begins = np.concatenate([[0], np.cumsum(counts)])
    local = np.column_stack([rng.uniform(-0.4, 0.4, (begins[-1], 2)), rng.uniform(0.5, 0.501, begins[-1])])
    position, rotation = rng.standard_normal(3), np.linalg.qr(rng.standard_normal((3, 3)))[0]
    points, forces = position + local @ rotation.T, rng.uniform(0.1, 3.0, begins[-1])
    contacts = TargetContacts(0, np.arange(1, 5), begins, points, forces, np.tile(rotation[:, 2], (len(points), 1)))
    return contacts, position, rotation


@pytest.mark.parametrize("seed", range(6))
def test_packed_patches_are_those_of_each_geom(block: Atlas, seed: int) -> None:
    contacts, position, rotation = random_contacts(seed)
    patches = find_patches(contacts, Pose(position, rotation), RADII, CONVEX)
    surface, texels = block.nearest(patches.points)
    load_points = find_load_points(patches, surface, texels, 0.5)
    for i, other in enumerate(contacts.others):
        rows, mine = slice(*contacts.begins[i : i + 2]), slice(*load_points.begins[i : i + 2])
        points, forces = (contacts.points[rows] - position) @ rotation, contacts.forces[rows]
        middle = patches.points[patches.begins[i]]
        np.testing.assert_allclose(middle, forces @ points / forces.sum(), atol=1e-12)
        assert patches.forces[i] == pytest.approx(forces.sum())
        loads, probes = find_probes(points, forces, RADII[other], CONVEX[other])
        at, spread_forces, radius, known = spread(0.5 * loads, probes, block.project(probes)[0], RADII[other])
        assert (load_points.geoms[mine] == other).all()
        np.testing.assert_allclose(load_points.points[mine], at, atol=1e-12)
        np.testing.assert_allclose(load_points.forces[mine], spread_forces, rtol=1e-9)
        np.testing.assert_allclose(load_points.radii[mine], radius)
        assert load_points.forces[mine].sum() == pytest.approx(forces.sum() / 2), "half of the force was asked for"
        assert ((load_points.texels[mine] >= 0) == (known >= 0)).all()
    seen = load_points.texels >= 0
    assert seen.any()
    places, nearest = block.nearest(load_points.points[seen])
    np.testing.assert_allclose(load_points.places[seen], places, atol=1e-12)
    np.testing.assert_array_equal(load_points.texels[seen], nearest)


def random_pose(seed: int) -> tuple[Pose, np.ndarray]:
    """A pose and its quaternion."""
    rng = np.random.default_rng(seed)
    quaternion = rng.standard_normal(4)
    quaternion /= np.linalg.norm(quaternion)
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, quaternion)
    return Pose(rng.standard_normal(3), rotation.reshape(3, 3)), quaternion


@pytest.mark.parametrize("seed", range(3))
def test_points_go_into_the_world_as_mujoco_takes_them(seed: int) -> None:
    pose, quaternion = random_pose(seed)
    points = np.random.default_rng(seed + 10).standard_normal((7, 3))
    expected, no_turn = np.zeros(3), np.zeros(4)
    for point, found in zip(points, in_world(points, pose), strict=True):
        mujoco.mju_trnVecPose(expected, pose.position, quaternion, point)
        np.testing.assert_allclose(found, expected, atol=1e-14)
    back = np.zeros(3)
    mujoco.mju_negPose(back, no_turn, pose.position, quaternion)
    for point, found in zip(points, in_frame(points, pose), strict=True):
        mujoco.mju_trnVecPose(expected, back, no_turn, point)
        np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("seed", range(3))
def test_there_and_back_is_where_it_began(seed: int) -> None:
    pose, _ = random_pose(seed)
    points = 100 * np.random.default_rng(seed).standard_normal((20, 3))
    np.testing.assert_allclose(in_frame(in_world(points, pose), pose), points, atol=1e-12)
    np.testing.assert_allclose(in_world(in_frame(points, pose), pose), points, atol=1e-12)


def test_a_geom_placed_on_a_turned_body_has_its_corners_where_its_frame_says() -> None:
    """A box inside a body inside a body: its corner, marked by a site of its own, is at the same place in the world."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body pos="1 2 3" euler="20 30 40"><body pos="-0.5 0 1" euler="0 70 0">
        <geom name="box" type="box" size="0.1 0.2 0.3" pos="0.4 0 0"/>
        <site name="corner" pos="0.5 0.2 0.3"/></body></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pose = Pose(data.geom("box").xpos, data.geom("box").xmat.reshape(3, 3))
    [corner] = in_world(np.array([[0.1, 0.2, 0.3]]), pose)
    np.testing.assert_allclose(corner, data.site("corner").xpos, atol=1e-14)


def test_no_points_stay_no_points_and_the_given_ones_are_not_changed() -> None:
    pose, _ = random_pose(0)
    assert in_frame(np.zeros((0, 3)), pose).shape == in_world(np.zeros((0, 3)), pose).shape == (0, 3)
    points = np.random.default_rng(0).standard_normal((4, 3))
    before = points.copy()
    in_frame(points, pose), in_world(points, pose)
    np.testing.assert_array_equal(points, before)
