"""The atlas of a given sphere map: symmetric, covariant, and on the mesh.

The cube's chart map: from points to directions, charts, texels and texture coordinates, and back.

Figures of merit of a sphere map, where they are known.

The analytic atlas of a sphere.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from genus_zero import TETRAHEDRON, bipyramid, icosphere, spiky

from ripple_sim.solver import AtlasError, Mesh, sphere_atlas
from ripple_sim.solver.layouts.cube import atlas
from ripple_sim.solver.layouts.cube.atlas import (
    CubeChartMap,
    _interpolate,
    atlas_from_sphere_map,
    sphere_map_quality,
    texel_at,
)
from ripple_sim.solver.layouts.cube.convention import cube_rotations, permute_texels, texel_directions
from ripple_sim.solver.texels.topology import QUANTILES

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


@pytest.fixture(scope="module")
def mesh() -> Mesh:
    """An ellipsoid whose sphere map is the icosphere that it comes from."""
    V, F = icosphere(2)
    return Mesh(V * [1.0, 2.0, 0.5], F)


@pytest.fixture(scope="module")
def chart_map() -> CubeChartMap:
    return CubeChartMap(icosphere(2)[0])


def test_coordinates_are_unit_directions_of_the_same_point_of_the_sphere_map(mesh: Mesh, chart_map) -> None:
    rng = np.random.default_rng(0)
    triangles, weights = rng.integers(0, len(mesh.F), 100), rng.dirichlet(np.ones(3), 100)
    points = np.einsum("ij,ijk->ik", weights, mesh.V[mesh.F[triangles]])
    found = chart_map.coordinates(mesh, triangles, points)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1)
    flat = np.einsum("ij,ijk->ik", weights, chart_map.linear_parts(mesh).coordinates[triangles])
    np.testing.assert_allclose(np.cross(found, flat), 0, atol=1e-12)
    assert (np.einsum("ij,ij->i", found, flat) > 0).all()


def test_chart_points_texture_coordinates_and_texels_say_the_same(chart_map: CubeChartMap) -> None:
    n = 8
    directions = np.random.default_rng(1).standard_normal((300, 3))
    chart, row, column = chart_map.chart_points(directions, n)
    uv = chart_map.uv(directions, chart)
    np.testing.assert_allclose(n * uv - 0.5, np.stack([column, row], axis=1), atol=1e-12)
    nearest = np.array([texel_at(*direction, n) for direction in directions])
    np.testing.assert_array_equal(nearest, (chart * n + np.rint(row).astype(int)) * n + np.rint(column).astype(int))
    cosine = np.einsum("ij,ij->i", directions, texel_directions(n).reshape(-1, 3)[nearest])
    assert (cosine / np.linalg.norm(directions, axis=1) > np.cos(np.pi / 4 / n * 2**0.5)).all()


def test_pieces_of_each_triangle_fill_it_and_lie_in_their_chart(mesh: Mesh, chart_map: CubeChartMap) -> None:
    corners = chart_map.linear_parts(mesh).coordinates
    cut = chart_map.split(corners)
    share = np.linalg.det(cut.barycentrics)
    np.testing.assert_allclose(np.bincount(cut.triangle, share, len(mesh.F)), 1, atol=1e-10)
    middle = np.einsum("pij,pjk->pk", cut.barycentrics, corners[cut.triangle])
    np.testing.assert_array_equal(chart_map.chart_points(middle, 4)[0], cut.chart)
    assert len(cut.chart) > len(mesh.F)


def test_stored_arrays_make_the_same_map_again(mesh: Mesh, chart_map: CubeChartMap) -> None:
    again = CubeChartMap(**chart_map.arrays())
    np.testing.assert_array_equal(again.linear_parts(mesh).coordinates, chart_map.linear_parts(mesh).coordinates)
    assert again.quality(mesh) == chart_map.quality(mesh)


def unit(V: np.ndarray) -> np.ndarray:
    return V / np.linalg.norm(V, axis=1, keepdims=True)


def test_a_regular_solid_is_spread_evenly() -> None:
    V, F = TETRAHEDRON
    quality = sphere_map_quality(Mesh(V, F), unit(V))
    assert quality["flipped"] == 0
    assert quality["solid_angle"] == pytest.approx(4 * np.pi)
    assert quality["starved"] == 0
    for name in QUANTILES:
        assert quality[name] == pytest.approx(1)


def test_a_map_inside_out_has_every_triangle_flipped() -> None:
    V, F = icosphere(1)
    quality = sphere_map_quality(Mesh(V, F), -V)
    assert quality["flipped"] == len(F)
    assert quality["solid_angle"] == pytest.approx(-4 * np.pi)


@pytest.mark.parametrize(("subdivisions", "starved"), [(0, 0.0), (2, 1.0)])
def test_a_needle_is_starved_when_its_triangles_have_too_small_a_share_of_the_sphere(
    subdivisions: int, starved: float
) -> None:
    # five triangles hold all the area: of 20 their stretch is 2, of 320 it is 8
    sphere, F = icosphere(subdivisions)
    V = sphere.copy()
    V[0] *= 1e5
    assert (F == 0).sum() == 5
    quality = sphere_map_quality(Mesh(V, F), sphere)
    assert quality["starved"] == pytest.approx(starved, abs=1e-3)
    assert quality["q50"] == pytest.approx({0: 2, 2: 8}[subdivisions], rel=0.15)


def test_quality_does_not_know_size_and_place() -> None:
    sphere, F = icosphere(2)
    V = sphere * [1, 2, 0.5]
    here, there = (sphere_map_quality(Mesh(points, F), sphere) for points in (V, 1e4 * V + [5, 6, 7]))
    assert here == pytest.approx(there)
    values = [here[name] for name in QUANTILES]
    assert values == sorted(values) and values[0] < values[-1]


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
