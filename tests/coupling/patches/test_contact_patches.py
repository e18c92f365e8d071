"""The packed patches of all geoms on a target are those of each geom alone."""

import numpy as np
import pytest

from ripple_sim.coupling.contacts import TargetContacts
from ripple_sim.coupling.patches import Pose, find_load_points, find_patches, find_probes, spread
from ripple_sim.solver import Atlas

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
