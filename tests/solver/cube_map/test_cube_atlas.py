"""The atlas of a given sphere map: symmetric, covariant, and on the mesh."""

import numpy as np
import pytest
import trimesh
from genus_zero import bipyramid, icosphere, spiky

from ripple_sim.solver import AtlasError, Mesh
from ripple_sim.solver.layouts.cube import atlas
from ripple_sim.solver.layouts.cube.atlas import _interpolate, atlas_from_sphere_map
from ripple_sim.solver.layouts.cube.convention import cube_rotations, permute_texels, texel_directions

BALL = Mesh(*icosphere(2))


def test_texels_lie_where_their_rays_meet_the_mesh() -> None:
    atlas = atlas_from_sphere_map(BALL, BALL.V, 8)
    np.testing.assert_allclose(np.cross(atlas.positions, texel_directions(8)), 0, atol=1e-12)
    corners = BALL.V[BALL.F[atlas.triangles]]
    np.testing.assert_allclose(np.einsum("...i,...ij->...j", atlas.barycentrics, corners), atlas.positions, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(atlas.normals, axis=-1), 1)
    # on a sphere normals are directions
    assert np.einsum("...i,...i->...", atlas.normals, texel_directions(8)).min() > 0.999


def test_areas_add_up_to_the_surface() -> None:
    atlas = atlas_from_sphere_map(BALL, BALL.V, 8)
    assert atlas.areas.min() > 0
    assert atlas.areas.sum() == pytest.approx(BALL.area, rel=1e-4)


@pytest.mark.parametrize("n", [4, 7, 16])
def test_an_octahedron_has_all_symmetries_of_the_cube(n: int) -> None:
    solid = trimesh.Trimesh(*bipyramid(4), process=False).subdivide()
    mesh = Mesh(np.array(solid.vertices), np.array(solid.faces))
    atlas = atlas_from_sphere_map(mesh, mesh.V / np.linalg.norm(mesh.V, axis=1, keepdims=True), n)
    for rotation in cube_rotations():
        np.testing.assert_allclose(permute_texels(atlas.areas, rotation), atlas.areas, rtol=1e-9)
        np.testing.assert_allclose(permute_texels(atlas.positions, rotation), atlas.positions @ rotation, atol=1e-9)


def test_a_mesh_moved_turned_and_enlarged_takes_its_texels_along() -> None:
    V = BALL.V * [1.0, 0.6, 1.4]
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3]
    here = atlas_from_sphere_map(Mesh(V, BALL.F), BALL.V, 6)
    there = atlas_from_sphere_map(Mesh(3 * V @ turn.T + [1, 2, 3], BALL.F), BALL.V, 6)
    np.testing.assert_allclose(there.positions, 3 * here.positions @ turn.T + [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(there.normals, here.normals @ turn.T, atol=1e-12)
    np.testing.assert_allclose(there.areas, 9 * here.areas, rtol=1e-9)


def test_casting_a_few_rays_or_all_gives_the_same_atlas(monkeypatch: pytest.MonkeyPatch) -> None:
    V, F = spiky(3)
    sphere = icosphere(3)[0]
    few = atlas_from_sphere_map(Mesh(V, F), sphere, 16)
    assert texel_directions(16).size > 3 * len(F)
    monkeypatch.setattr(atlas, "STRIDE", 1)
    every = atlas_from_sphere_map(Mesh(V, F), sphere, 16)
    np.testing.assert_allclose(few.positions, every.positions, atol=1e-12)
    np.testing.assert_allclose(few.areas, every.areas, rtol=1e-9)


def test_where_opposite_normals_cancel_a_corners_own_is_taken() -> None:
    normals = np.array([[0.0, 0, 1], [0, 0, -1], [1, 0, 0]])
    places = np.array([[0.5, 0.5, 0.0], [0.25, 0.25, 0.5], [0.75, 0.25, 0]])
    positions, found = _interpolate((np.eye(3), normals), np.array([[0, 1, 2]]), np.zeros(3, np.int64), places)
    np.testing.assert_array_equal(found, [[0, 0, 1], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_array_equal(positions, places)


@pytest.mark.parametrize("resolution", [3, 5.5, 10**6])
def test_an_invalid_resolution_is_named(resolution: float) -> None:
    with pytest.raises(AtlasError, match=rf"resolution is {resolution}; valid is a whole number"):
        atlas_from_sphere_map(BALL, BALL.V, resolution)
