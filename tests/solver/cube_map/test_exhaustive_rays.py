"""Every ray against every triangle: on an octahedron the answer is known in closed form."""

import numpy as np
import pytest
from genus_zero import bipyramid, icosphere

from ripple_sim.solver.layouts.cube.rays import cast_rays_exhaustively

V, F = bipyramid(4)


def test_a_ray_meets_the_octants_own_triangle_at_the_shares_of_its_coordinates() -> None:
    directions = np.random.default_rng(0).standard_normal((200, 3))
    triangles, barycentrics = cast_rays_exhaustively(V, F, directions)
    corners = V[F[triangles]]
    # the corners are the axes on the ray's side
    np.testing.assert_array_equal(np.sign(corners.sum(axis=1).round(9)), np.sign(directions))
    share = np.abs(directions) / np.abs(directions).sum(axis=1, keepdims=True)
    axis = np.abs(corners).argmax(axis=2)
    np.testing.assert_allclose(barycentrics, np.take_along_axis(share, axis, axis=1), atol=1e-12)


def test_hits_lie_on_the_ray_never_behind_it() -> None:
    sphere, faces = icosphere(1)
    directions = np.random.default_rng(1).standard_normal((100, 3))
    triangles, barycentrics = cast_rays_exhaustively(sphere, faces, directions)
    hit = np.einsum("ij,ijk->ik", barycentrics, sphere[faces[triangles]])
    np.testing.assert_allclose(np.cross(hit, directions), 0, atol=1e-12)
    assert (np.einsum("ij,ij->i", hit, directions) > 0).all()
    assert barycentrics.min() >= 0
    np.testing.assert_allclose(barycentrics.sum(axis=1), 1)


@pytest.mark.parametrize("length", [1e-6, 1e6])
def test_the_length_of_a_ray_does_not_matter(length: float) -> None:
    directions = np.random.default_rng(2).standard_normal((50, 3))
    triangles, barycentrics = cast_rays_exhaustively(V, F, directions)
    others, weights = cast_rays_exhaustively(V, F, length * directions)
    np.testing.assert_array_equal(others, triangles)
    np.testing.assert_allclose(weights, barycentrics, atol=1e-12)


def test_rays_through_vertices_and_edges_hit_one_of_the_triangles_there() -> None:
    directions = np.concatenate([V, V[F[:, 0]] + V[F[:, 1]]])
    triangles, barycentrics = cast_rays_exhaustively(V, F, directions)
    hit = np.einsum("ij,ijk->ik", barycentrics, V[F[triangles]])
    np.testing.assert_allclose(hit, directions / np.abs(directions).sum(axis=1, keepdims=True), atol=1e-12)


def test_no_rays_hit_nothing() -> None:
    triangles, barycentrics = cast_rays_exhaustively(V, F, np.zeros((0, 3)))
    assert triangles.shape == (0,) and barycentrics.shape == (0, 3)
