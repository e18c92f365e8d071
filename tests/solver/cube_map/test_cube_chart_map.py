"""The cube's chart map: from points to directions, charts, texels and texture coordinates, and back."""

import numpy as np
import pytest
from genus_zero import icosphere

from ripple_sim.solver import Mesh
from ripple_sim.solver.layouts.cube.atlas import CubeChartMap
from ripple_sim.solver.layouts.cube.convention import texel_directions
from ripple_sim.solver.layouts.cube.rays import texel_at


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
