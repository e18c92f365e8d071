"""Atlases of given sphere maps: symmetric, covariant and on the mesh; the sphere's."""

import itertools

import numpy as np
import pytest
import trimesh
from atlas import cast_rays_exhaustively
from cube_symmetry import cube_rotations, permute_texels
from genus_zero import TETRAHEDRON, bipyramid, icosphere

from ripple_sim.solver import Atlas, Mesh, sphere_atlas
from ripple_sim.solver.layouts.cube import (
    CubeChartMap,
    atlas_from_sphere_map,
    cast_rays,
    sphere_directions,
    texel_directions,
)
from ripple_sim.solver.texels import QUANTILES

BALL = Mesh(*icosphere(2))


def test_texels_lie_where_their_rays_meet_the_mesh() -> None:
    atlas = atlas_from_sphere_map(BALL, BALL.V, 8)
    np.testing.assert_allclose(np.cross(atlas.positions, texel_directions(8)), 0, atol=1e-12)
    corners = BALL.V[BALL.F[atlas.triangles]]
    np.testing.assert_allclose(
        np.einsum("...i,...ij->...j", atlas.barycentrics, corners), atlas.positions, atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.norm(atlas.normals, axis=-1), 1)
    # on a sphere normals are directions
    assert np.einsum("...i,...i->...", atlas.normals, texel_directions(8)).min() > 0.999


@pytest.mark.parametrize("n", [4, 7, 16])
def test_an_octahedron_has_all_symmetries_of_the_cube(n: int) -> None:
    solid = trimesh.Trimesh(*bipyramid(4), process=False).subdivide()
    mesh = Mesh(np.array(solid.vertices), np.array(solid.faces))
    atlas = atlas_from_sphere_map(mesh, mesh.V / np.linalg.norm(mesh.V, axis=1, keepdims=True), n)
    for rotation in cube_rotations():
        np.testing.assert_allclose(permute_texels(atlas.areas, rotation), atlas.areas, rtol=1e-9)
        np.testing.assert_allclose(
            permute_texels(atlas.positions, rotation), atlas.positions @ rotation, atol=1e-9
        )


def test_a_mesh_moved_turned_and_enlarged_takes_its_texels_along() -> None:
    V = BALL.V * [1.0, 0.6, 1.4]
    turn = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3]
    here = atlas_from_sphere_map(Mesh(V, BALL.F), BALL.V, 6)
    there = atlas_from_sphere_map(Mesh(3 * V @ turn.T + [1, 2, 3], BALL.F), BALL.V, 6)
    np.testing.assert_allclose(there.positions, 3 * here.positions @ turn.T + [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(there.normals, here.normals @ turn.T, atol=1e-12)
    np.testing.assert_allclose(there.areas, 9 * here.areas, rtol=1e-9)


def test_a_regular_solid_is_spread_evenly() -> None:
    V, F = TETRAHEDRON
    quality = CubeChartMap(V / np.sqrt(3)).quality(Mesh(V, F))
    assert quality["flipped"] == 0
    assert quality["solid_angle"] == pytest.approx(4 * np.pi)
    assert quality["starved"] == 0
    for name in QUANTILES:
        assert quality[name] == pytest.approx(1)


@pytest.mark.parametrize(("subdivisions", "starved"), [(0, 0.0), (2, 1.0)])
def test_a_needle_is_starved_when_its_triangles_have_too_small_a_share_of_the_sphere(
    subdivisions: int, starved: float
) -> None:
    # five triangles hold all the area: of 20 their stretch is 2, of 320 it is 8
    sphere, F = icosphere(subdivisions)
    V = sphere.copy()
    V[0] *= 1e5
    assert (F == 0).sum() == 5
    quality = CubeChartMap(sphere).quality(Mesh(V, F))
    assert quality["starved"] == pytest.approx(starved, abs=1e-3)
    assert quality["q50"] == pytest.approx({0: 2, 2: 8}[subdivisions], rel=0.15)


def test_sphere_atlas_is_exact() -> None:
    atlas = sphere_atlas(2.5, 24)
    np.testing.assert_allclose(np.linalg.norm(atlas.positions, axis=-1), 2.5, rtol=1e-15)
    assert atlas.radius == pytest.approx(2.5)
    mesh = Mesh.from_arrays(atlas.mesh.V, atlas.mesh.F)
    assert mesh.notes == ()
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 2.5**3, rel=0.01)
    points, directions = atlas.project([[0, 0, 9.0], [1, 1, 1]])
    np.testing.assert_allclose(points[0], [0, 0, 2.5])
    np.testing.assert_allclose(directions[1], np.ones(3) / np.sqrt(3))


def surface_points(atlas: Atlas, triangles: np.ndarray, barycentrics: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ijk->ik", barycentrics, atlas.mesh.V[atlas.mesh.F[triangles]])


def test_rays_agree_with_every_ray_against_every_triangle(animal: Atlas) -> None:
    directions = texel_directions(8).reshape(-1, 3)
    triangles, barycentrics = cast_rays(animal.sphere, animal.mesh, directions)
    expected, weights = cast_rays_exhaustively(animal.sphere, animal.mesh.F, directions)
    assert weights.min() > -1e-12
    # a ray through an edge may count to either side; the point is the same
    differ = triangles != expected
    assert differ.mean() < 0.05
    assert np.abs(weights[differ].min(axis=1)).max(initial=0) < 1e-9
    np.testing.assert_allclose(barycentrics[~differ], weights[~differ], atol=1e-9)
    points = surface_points(animal, triangles, barycentrics)
    others = surface_points(animal, expected, weights)
    np.testing.assert_allclose(points, others, atol=1e-9)
    assert (barycentrics >= 0).all()
    np.testing.assert_allclose(barycentrics.sum(axis=1), 1)


def test_rays_that_walk_on_from_their_neighbours_hit_the_same(animal: Atlas) -> None:
    n = 48
    directions = texel_directions(n).reshape(-1, 3)
    triangles, barycentrics = cast_rays(animal.sphere, animal.mesh, directions)
    for stride in (3, 16, len(directions)):
        walked, weights = cast_rays(animal.sphere, animal.mesh, directions, stride)
        inside = barycentrics.min(axis=1) > 0
        np.testing.assert_array_equal(walked[inside], triangles[inside])
        np.testing.assert_array_equal(weights[inside], barycentrics[inside])
        assert inside.mean() > 0.9
        points = surface_points(animal, walked, weights)
        others = surface_points(animal, triangles, barycentrics)
        np.testing.assert_allclose(points, others, atol=1e-12)


@pytest.mark.parametrize(
    "what", ["cube edges and corners", "edges and vertices of the mesh", "anywhere"]
)
def test_rays_in_degenerate_directions_agree_too(what: str) -> None:
    coarse = trimesh.creation.icosphere(subdivisions=2)
    V = np.array(coarse.vertices)
    F = np.array(coarse.faces)
    if what == "cube edges and corners":
        directions = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
    elif what == "edges and vertices of the mesh":
        directions = np.concatenate([V, (V[F[:, 0]] + V[F[:, 1]]) / 2])
    else:
        directions = np.random.default_rng(0).standard_normal((200, 3))
    found, weights = cast_rays(V, Mesh(V, F), directions)
    expected, expected_weights = cast_rays_exhaustively(V, F, directions)
    hit, other = (
        np.einsum("ij,ijk->ik", w, V[F[t]])
        for t, w in ((found, weights), (expected, expected_weights))
    )
    np.testing.assert_allclose(hit, other, atol=1e-9)
    np.testing.assert_allclose(np.cross(hit, directions), 0, atol=1e-9)
    assert (np.einsum("ij,ij->i", hit, directions) > 0).all()


def test_a_triangle_without_area_gives_its_middle() -> None:
    V = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    [found] = sphere_directions(V[None], np.eye(3)[None], V[:1])
    np.testing.assert_allclose(found, np.full(3, 3**-0.5))
