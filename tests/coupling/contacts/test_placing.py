"""Contacts off the surface find the nearest part of it that faces them."""

import numpy as np
import pytest
import trimesh

from ripple_sim.coupling.placing import places
from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas


@pytest.fixture(scope="module")
def plate() -> Atlas:
    """1 m by 1 m, 0.1 m thick."""
    solid = trimesh.creation.box(extents=(1, 1, 0.1)).subdivide_to_size(0.1)
    return build_atlas(Mesh.from_arrays(solid.vertices, solid.faces), 24, cache=False)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("height", [-0.2, -0.04, 0.0, 0.04, 0.2])
def test_contact_with_a_thin_part_is_placed_on_its_own_side(plate: Atlas, side: float, height: float) -> None:
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-0.35, 0.35, (20, 2)), np.full(20, height)])
    normals = np.tile([0.0, 0.0, side], (20, 1))
    placed = places(plate, points, normals)
    np.testing.assert_allclose(placed[:, 2], 0.05 * side, atol=1e-12)
    # on the other side to a texel, or else straight above
    nearer = abs(height - 0.05 * side) < abs(height + 0.05 * side)
    off = np.linalg.norm((placed - points)[:, :2], axis=1)
    assert off.max() < (1e-6 if nearer else 1.5 * np.sqrt(plate.areas.max()))


def test_point_is_the_nearest_of_all_that_face_the_contact(animal: Atlas) -> None:
    rng = np.random.default_rng(4)
    positions, outward = animal.positions.reshape(-1, 3), animal.normals.reshape(-1, 3)
    points = rng.choice(positions, 60) + rng.normal(0, 0.03, (60, 3))
    normals = rng.standard_normal((60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    texel = np.sqrt(animal.areas.max())
    for point, normal, place in zip(points, normals, places(animal, points, normals), strict=True):
        [there] = animal.nearest_texel(place)
        assert outward[there] @ normal > 0
        least = np.linalg.norm(positions[outward @ normal > 0.25] - point, axis=1).min()
        assert np.linalg.norm(place - point) <= least + 1e-9
        assert np.linalg.norm(positions[there] - place) < texel


def test_where_nothing_faces_a_contact_the_nearest_point_is_taken() -> None:
    atlas = sphere_atlas(1.0, 8)
    [place] = places(atlas, np.array([[0.0, 0.0, 1.1]]), np.zeros((1, 3)))
    np.testing.assert_allclose(place, [0, 0, 1], atol=0.02)
