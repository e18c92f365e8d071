"""Medial radii of solids on which they are known, and that they keep moved points apart."""

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas
from ripple_sim.solver.texels.thickness import LEAST, medial_radius


@pytest.mark.parametrize("radius", [1e-3, 1.0, 1e3])
def test_of_a_sphere_it_is_the_radius_at_any_scale(radius: float) -> None:
    np.testing.assert_allclose(medial_radius(sphere_atlas(radius, 16)), radius, rtol=2e-3)


def test_of_a_tube_it_is_the_tubes_radius_away_from_its_ends() -> None:
    solid = trimesh.creation.capsule(height=0.8, radius=0.1, count=(48, 48))
    atlas = build_atlas(Mesh.from_arrays(solid.vertices, solid.faces), 32, cache=False)
    middle = np.abs(atlas.positions[..., 2] - solid.centroid[2]) < 0.3
    assert middle.sum() > 500
    np.testing.assert_allclose(medial_radius(atlas)[middle], 0.1, rtol=0.1)


def test_points_moved_by_less_stay_nearest_to_where_they_came_from(animal: Atlas) -> None:
    size = np.ptp(animal.mesh.V, axis=0).max()
    points, normals = animal.positions.reshape(-1, 3), animal.normals.reshape(-1, 3)
    radius = medial_radius(animal).reshape(-1)
    assert radius.min() >= LEAST * size * (1 - 1e-12)
    tree = cKDTree(points)
    for side in (-1.0, 1.0):
        moved = points + side * 0.6 * radius[:, None] * normals
        _, nearest = tree.query(moved)
        # but for details smaller than those that count
        assert np.linalg.norm(points[nearest] - points, axis=1).max() < 3 * LEAST * size
