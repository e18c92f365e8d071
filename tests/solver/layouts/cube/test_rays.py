"""Rays through the texels meet the triangles that they should.

Every ray against every triangle: on an octahedron the answer is known in closed form.

From points on triangles to directions and texels, against the same written with whole arrays.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh
from genus_zero import bipyramid

from ripple_sim.solver import Atlas
from ripple_sim.solver.layouts.cube.atlas import cast_rays, cast_rays_exhaustively, sphere_directions, texel_at
from ripple_sim.solver.layouts.cube.convention import cube_chart_points, cube_rotations, texel_directions


def surface_points(atlas: Atlas, triangles: np.ndarray, barycentrics: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ijk->ik", barycentrics, atlas.mesh.V[atlas.mesh.F[triangles]])


def test_rays_agree_with_every_ray_against_every_triangle(animal: Atlas) -> None:
    directions = texel_directions(8).reshape(-1, 3)
    triangles, barycentrics = cast_rays(animal.sphere, animal.mesh.F, directions)
    expected, weights = cast_rays_exhaustively(animal.sphere, animal.mesh.F, directions)
    assert weights.min() > -1e-12
    # a ray through an edge may count to either side; the point is the same
    differ = triangles != expected
    assert differ.mean() < 0.05
    assert np.abs(weights[differ].min(axis=1)).max(initial=0) < 1e-9
    np.testing.assert_allclose(barycentrics[~differ], weights[~differ], atol=1e-9)
    points, others = surface_points(animal, triangles, barycentrics), surface_points(animal, expected, weights)
    np.testing.assert_allclose(points, others, atol=1e-9)
    assert (barycentrics >= 0).all()
    np.testing.assert_allclose(barycentrics.sum(axis=1), 1)


def test_rays_that_walk_on_from_their_neighbours_hit_the_same(animal: Atlas) -> None:
    n = 48
    directions = texel_directions(n).reshape(-1, 3)
    triangles, barycentrics = cast_rays(animal.sphere, animal.mesh.F, directions)
    for stride in (3, 16, len(directions)):
        walked, weights = cast_rays(animal.sphere, animal.mesh.F, directions, stride)
        inside = barycentrics.min(axis=1) > 0
        np.testing.assert_array_equal(walked[inside], triangles[inside])
        np.testing.assert_array_equal(weights[inside], barycentrics[inside])
        assert inside.mean() > 0.9
        points, others = surface_points(animal, walked, weights), surface_points(animal, triangles, barycentrics)
        np.testing.assert_allclose(points, others, atol=1e-12)


@pytest.mark.parametrize("what", ["cube edges and corners", "edges and vertices of the mesh", "anywhere"])
def test_rays_in_degenerate_directions_agree_too(what: str) -> None:
    coarse = trimesh.creation.icosphere(subdivisions=2)
    V, F = np.array(coarse.vertices), np.array(coarse.faces)
    if what == "cube edges and corners":
        directions = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
    elif what == "edges and vertices of the mesh":
        directions = np.concatenate([V, (V[F[:, 0]] + V[F[:, 1]]) / 2])
    else:
        directions = np.random.default_rng(0).standard_normal((200, 3))
    found, weights = cast_rays(V, F, directions)
    expected, expected_weights = cast_rays_exhaustively(V, F, directions)
    hit, other = (np.einsum("ij,ijk->ik", w, V[F[t]]) for t, w in ((found, weights), (expected, expected_weights)))
    np.testing.assert_allclose(hit, other, atol=1e-9)
    np.testing.assert_allclose(np.cross(hit, directions), 0, atol=1e-9)
    assert (np.einsum("ij,ij->i", hit, directions) > 0).all()


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


@pytest.mark.parametrize("n", [4, 7, 32])
def test_texels_are_those_of_the_rounded_coordinates(n: int) -> None:
    rng = np.random.default_rng(n)
    directions = rng.standard_normal((4000, 3))
    # edges and corners of the cube too, which belong to several charts
    directions[:72] = np.concatenate(
        [[1, 1, 0] @ cube_rotations(), [1, 1, 1] @ cube_rotations(), [1, 0, 0] @ cube_rotations()]
    )
    chart, row, column = cube_chart_points(directions, n)
    row, column = (np.clip(np.rint(each).astype(int), 0, n - 1) for each in (row, column))
    found = [texel_at(*direction, n) for direction in directions]
    np.testing.assert_array_equal(found, (chart * n + row) * n + column)
    found = [texel_at(*direction, n) for direction in texel_directions(n).reshape(-1, 3)]
    np.testing.assert_array_equal(found, np.arange(6 * n * n))


def test_directions_interpolate_the_sphere_map(animal: Atlas) -> None:
    V, F, sphere = animal.mesh.V, animal.mesh.F, animal.sphere
    rng = np.random.default_rng(0)
    triangles, weights = rng.integers(0, len(F), 500), rng.dirichlet(np.ones(3), 500)
    points = np.einsum("ij,ijk->ik", weights, V[F[triangles]])
    expected = np.einsum("ij,ijk->ik", weights, sphere[F[triangles]])
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(sphere_directions(V, F, sphere, triangles, points), expected, atol=1e-9)


def test_a_triangle_without_area_gives_its_middle() -> None:
    V = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    [found] = sphere_directions(V, np.array([[0, 1, 2]]), np.eye(3), np.array([0]), V[:1])
    np.testing.assert_allclose(found, np.full(3, 3**-0.5))
