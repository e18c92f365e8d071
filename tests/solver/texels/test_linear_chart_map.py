"""The chart map of grids of points: linear in each triangle, and the same way back."""

import numpy as np
import pytest
from hand_made import polygon, square, two_squares

from ripple_sim.solver import Mesh, texel_atlas
from ripple_sim.solver.mesh.closest import triangle_tree
from ripple_sim.solver.texels.chart_map import LinearChartMap, MeshPlaces, nearest_places

# two triangles far apart and skewed, each on a chart of its own
V = np.array([[0.0, 0, 0], [2, 0, 1], [0, 3, 0], [5, 5, 5], [6, 5, 5], [5, 5, 9]])
MESH = Mesh(V, np.array([[0, 1, 2], [3, 4, 5]]))
CORNERS = np.array([[[-0.5, -0.5], [-0.5, 3.5], [3.5, 3.5]], [[0.0, 1], [2, 0], [1, 3]]])
MAP = LinearChartMap(np.array([2, 0]), CORNERS, 4)


def test_points_keep_their_barycentrics_on_the_chart() -> None:
    rng = np.random.default_rng(0)
    triangles, weights = rng.integers(0, 2, 100), rng.dirichlet(np.ones(3), 100)
    points = np.einsum("ij,ijk->ik", weights, V[MESH.F[triangles]])
    chart, row, column = MAP.chart_points(MAP.coordinates(MESH, triangles, points), 4)
    np.testing.assert_array_equal(chart, MAP.charts[triangles])
    expected = np.einsum("ij,ijk->ik", weights, CORNERS[triangles])
    np.testing.assert_allclose(np.stack([row, column], axis=1), expected, atol=1e-12)


def test_points_beside_a_triangle_stay_within_its_chart_triangle() -> None:
    points = 20 * np.random.default_rng(1).standard_normal((300, 3))
    _, row, column = MAP.chart_points(MAP.coordinates(MESH, np.zeros(300, np.int64), points), 4)
    # the half of the chart below its diagonal
    assert row.min() > -0.5 - 1e-12 and column.max() < 3.5 + 1e-12
    assert (row <= column + 1e-12).all()
    assert np.ptp(row) > 3 and np.ptp(column) > 3


@pytest.mark.parametrize("corners", [[[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[1, 1, 1]] * 3])
def test_a_triangle_without_area_gives_the_middle_of_its_place(corners: list) -> None:
    mesh = Mesh(np.array(corners, dtype=float), np.array([[0, 1, 2]]))
    [found] = MAP.coordinates(mesh, np.array([0]), mesh.V[:1])
    np.testing.assert_allclose(found, [2, *CORNERS[0].mean(axis=0)])


def test_the_border_belongs_to_the_last_texels() -> None:
    # on the plane of the first triangle, whose corners are at the corners of chart 2; the second is on chart 0
    charts = MAP.compiled(MESH, two_squares(4).topology)
    points = [V[0], V[1], V[2], V[:3].mean(axis=0), 2 * V[2] - V[0]]
    _, texels = nearest_places(MeshPlaces(triangle_tree(V, MESH.F), charts), np.array(points))
    assert texels.tolist() == [2 * 16, 2 * 16 + 3, 2 * 16 + 15, 2 * 16 + 4 + 2, 2 * 16 + 15]


@pytest.mark.parametrize("texels", [square(4), polygon(5, 4)])
def test_the_nearest_texel_is_the_one_whose_centre_is_nearest(texels) -> None:
    atlas = texel_atlas(texels)
    rng = np.random.default_rng(2)
    # within a quarter of a texel's width, in the plane
    near = rng.integers(0, texels.topology.texel_count, 100)
    width = np.sqrt(texels.areas.min())
    offset = np.concatenate([rng.uniform(-0.2, 0.2, (100, 2)) * width, np.zeros((100, 1))], axis=1)
    np.testing.assert_array_equal(atlas.nearest_texel(texels.positions.reshape(-1, 3)[near] + offset), near)


def test_texture_coordinates_are_column_and_row_from_0_to_1() -> None:
    coordinates = MAP.linear_parts(MESH).coordinates
    uv = MAP.uv(coordinates, MAP.charts)
    np.testing.assert_allclose(uv[0], [[0, 0], [1, 0], [1, 1]])
    np.testing.assert_allclose(uv[1], [[0.375, 0.125], [0.125, 0.625], [0.875, 0.375]])
    cut = MAP.split(coordinates)
    assert cut.triangle.tolist() == [0, 1] and cut.chart.tolist() == [2, 0]
    np.testing.assert_array_equal(cut.barycentrics, [np.eye(3)] * 2)


def test_stored_arrays_make_the_same_map_again() -> None:
    again = LinearChartMap(**MAP.arrays(), resolution=4)
    np.testing.assert_array_equal(again.linear_parts(MESH).coordinates, MAP.linear_parts(MESH).coordinates)
