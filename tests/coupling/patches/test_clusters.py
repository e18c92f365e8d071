"""Contacts near each other are joined; their forces and their force-weighted middle stay."""

import numpy as np

from ripple_sim.coupling.patches import MAX_CLUSTERS, cluster


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
