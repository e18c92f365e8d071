"""The cube map: directions, neighbours, symmetries, areas and texture coordinates."""

import numpy as np
import pytest
import trimesh

from ripple_sim.solver import Atlas, AtlasError, Mesh, build_atlas
from ripple_sim.solver.layouts import atlas_from_sphere_map, cube
from ripple_sim.solver.layouts.cube import cube_topology, texel_directions
from ripple_sim.solver.texels import TexelMesh


@pytest.mark.parametrize("n", [4, 7, 16])
def test_the_halo_holds_the_nearest_texels_across_the_edges(n: int) -> None:
    directions = texel_directions(n).reshape(-1, 3)
    index = cube_topology(n).halo
    for chart in range(6):
        for own, beside in (
            (index[chart, 1, 1:-1], index[chart, 0, 1:-1]),
            (index[chart, -2, 1:-1], index[chart, -1, 1:-1]),
            (index[chart, 1:-1, 1], index[chart, 1:-1, 0]),
            (index[chart, 1:-1, -2], index[chart, 1:-1, -1]),
        ):
            other = (directions[own] @ directions.T).copy()
            same_chart = np.arange(6 * n * n) // (n * n) == chart
            other[:, same_chart] = -1
            # the outermost texels stand at a cube corner, equally near to two charts
            np.testing.assert_array_equal(other.argmax(axis=1)[1:-1], beside[1:-1])
            assert (other[np.arange(n), beside] > other.max(axis=1) - 1e-12).all()
    assert (index < 0).sum() == 24


@pytest.mark.parametrize("bad", [0, 3, 2.5, -8, 10_000])
def test_invalid_resolution_is_named(bad: float) -> None:
    with pytest.raises(AtlasError, match=r"resolution must be a whole number"):
        cube.check_resolution(bad)


def spanned_areas(atlas: Atlas) -> np.ndarray:
    return TexelMesh.of(atlas.texels.topology, atlas.positions).cells.areas


@pytest.fixture(scope="module")
def creased() -> Atlas:
    """A long box: all its curvature is in its edges, which lie anywhere between the texels."""
    box = trimesh.creation.box(extents=[1.0, 0.6, 0.35]).subdivide().subdivide().subdivide()
    return build_atlas(Mesh.from_arrays(box.vertices, box.faces), 48, cache=False)


def test_areas_sum_to_that_of_a_creased_surface(creased: Atlas) -> None:
    area = creased.mesh.area
    # the texel mesh alone cuts the box's edges off
    assert spanned_areas(creased).sum() < 0.993 * area
    assert creased.quality()["coverage"] == pytest.approx(1, rel=1e-9)


def test_areas_are_those_of_the_texel_mesh_where_it_follows_the_surface(ball_mesh: Mesh) -> None:
    atlas = build_atlas(ball_mesh, 48)
    share = atlas.areas / spanned_areas(atlas)
    corners = np.zeros(share.shape, bool)
    corners[:, [0, 0, -1, -1], [0, -1, -1, 0]] = True
    np.testing.assert_allclose(share[~corners], 1, atol=0.01)
    # of a hexagon that three squares make, their centres' triangle and quads leave a seventh of
    # each
    np.testing.assert_allclose(share[corners], 8 / 7, atol=0.01)
    assert atlas.areas.sum() == pytest.approx(ball_mesh.area, rel=1e-9)


def test_limbs_that_fall_between_the_texels_are_not_covered(animal: Atlas) -> None:
    conformal = build_atlas(animal.mesh, 64, "conformal", cache=False)
    spanned = spanned_areas(conformal).sum() / animal.mesh.area
    assert spanned < 0.97
    assert conformal.quality()["coverage"] < (1 + spanned) / 2
    assert animal.quality()["coverage"] == pytest.approx(1, abs=3e-3)


def ball(subdivisions: int, resolution: int) -> Atlas:
    """A turned icosphere mapped onto itself; its triangles cross the cube's edges."""
    solid = trimesh.creation.icosphere(subdivisions=subdivisions)
    turned = solid.vertices @ trimesh.transformations.rotation_matrix(0.7, [1, 2, 3])[:3, :3].T
    mesh = Mesh.from_arrays(turned, solid.faces)
    return atlas_from_sphere_map(
        mesh, mesh.V / np.linalg.norm(mesh.V, axis=1, keepdims=True), resolution
    )


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def direction_at(chart: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """The direction of a chart point, by the definition of the equiangular cube map."""
    a, b = np.tan(np.pi / 4 * (2 * uv - 1)).T
    return unit(
        cube.CHART_NORMALS[chart]
        + a[:, None] * cube.CHART_U[chart]
        + b[:, None] * cube.CHART_V[chart]
    )


def test_pieces_make_up_every_triangle_in_its_winding() -> None:
    atlas = ball(2, 8)
    coordinates = atlas.texture_coordinates()
    share = np.linalg.det(coordinates.barycentrics)
    assert (share > 0).all()
    # on the charts too
    assert (np.linalg.det(coordinates.uv[:, 1:] - coordinates.uv[:, :1]) > 0).all()
    np.testing.assert_allclose(np.bincount(coordinates.triangle, share), 1, atol=1e-10)
    assert (coordinates.barycentrics >= 0).all()
    np.testing.assert_allclose(coordinates.barycentrics.sum(axis=2), 1)
    assert (np.diff(coordinates.triangle) >= 0).all()
    corners = coordinates.carry(atlas.mesh.V[atlas.mesh.F])
    area = (
        np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        ).sum()
        / 2
    )
    assert area == pytest.approx(atlas.mesh.area)


def test_every_corner_of_the_mesh_has_exact_coordinates(animal: Atlas) -> None:
    coordinates = animal.texture_coordinates()
    at_corner = coordinates.barycentrics.max(axis=2) == 1
    corner = coordinates.barycentrics.argmax(axis=2)
    piece, corner_of_piece = np.nonzero(at_corner)
    corners = np.stack([coordinates.triangle[piece], corner[piece, corner_of_piece]], axis=1)
    assert len(np.unique(corners, axis=0)) == animal.mesh.F.size
    assert coordinates.uv.min() >= 0
    assert coordinates.uv.max() <= 1
    directions = unit(coordinates.carry(animal.sphere[animal.mesh.F]))
    for k in range(3):
        found = direction_at(coordinates.chart, coordinates.uv[:, k])
        np.testing.assert_allclose(found, directions[:, k], atol=1e-11)  # round-off


def test_triangles_are_cut_exactly_where_they_cross_a_cube_edge(animal: Atlas) -> None:
    coordinates = animal.texture_coordinates()
    pieces = np.bincount(coordinates.triangle)
    corners = animal.sphere[animal.mesh.F]
    axis = np.abs(corners).argmax(axis=2)
    sign = np.sign(np.take_along_axis(corners, axis[..., None], axis=2))[..., 0]
    one_face = (axis == axis[:, :1]).all(axis=1) & (sign == sign[:, :1]).all(axis=1)
    assert (pieces[one_face] == 1).all()
    assert (pieces[~one_face] > 1).all()
    assert 0 < (~one_face).sum() < len(pieces) / 4


def test_interpolated_coordinates_converge_at_second_order() -> None:
    errors = []
    for subdivisions in (3, 4, 5):
        atlas = ball(subdivisions, 8)
        coordinates = atlas.texture_coordinates()
        # one random point inside each piece: its interpolated coordinates, and true direction
        weights = np.random.default_rng(0).dirichlet(np.ones(3), size=len(coordinates.chart))
        uv = np.einsum("pi,pij->pj", weights, coordinates.uv)
        directions = unit(
            np.einsum("pi,pij->pj", weights, coordinates.carry(atlas.sphere[atlas.mesh.F]))
        )
        distance = np.linalg.norm(direction_at(coordinates.chart, uv) - directions, axis=1)
        assert distance.max() < 0.01
        errors.append(np.sqrt((distance**2).mean()))
    assert errors[0] / errors[1] == pytest.approx(4, abs=0.4)
    assert errors[1] / errors[2] == pytest.approx(4, abs=0.4)


def test_triangles_as_large_as_a_quarter_of_the_sphere_are_cut() -> None:
    V = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    atlas = build_atlas(
        Mesh.from_arrays(V, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]), 8, cache=False
    )
    coordinates = atlas.texture_coordinates()
    assert set(coordinates.chart) == set(range(6))
    np.testing.assert_allclose(
        np.bincount(coordinates.triangle, np.linalg.det(coordinates.barycentrics)), 1
    )
