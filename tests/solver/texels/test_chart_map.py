"""Chart maps: texture coordinates, linear maps in triangles, and nearest places."""

from collections.abc import Callable

import numpy as np
import pytest
from genus_zero import icosphere
from hand_made import polygon, square, two_squares

from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas, texel_atlas
from ripple_sim.solver.layouts.cube import CubeChartMap, cube_topology
from ripple_sim.solver.mesh import ClosestPoints
from ripple_sim.solver.texels import (
    LinearChartMap,
    sampling_matrix,
    texture_coordinates,
    with_filled_halo,
)


def test_on_a_flat_square_texture_coordinates_are_the_points_themselves() -> None:
    atlas = texel_atlas(two_squares(4))
    found = atlas.texture_coordinates()
    points = found.carry(atlas.mesh.V[atlas.mesh.F])
    np.testing.assert_allclose(found.uv, points[..., :2], atol=1e-12)
    # the second chart is the square above
    np.testing.assert_array_equal(np.repeat(found.chart, 3), points[..., 2].ravel())
    np.testing.assert_allclose(
        found.coordinates[..., 1:], 4 * points[..., [1, 0]] - 0.5, atol=1e-12
    )


def test_linear_functions_in_a_triangle_are_kept_on_its_pieces() -> None:
    mesh = Mesh(*icosphere(1))
    found = texture_coordinates(CubeChartMap(mesh.V), mesh)
    assert len(found.triangle) > len(mesh.F)
    points = found.carry(mesh.V[mesh.F])
    # the same for vectors, numbers, and lists of them
    slope = np.array([0.3, -2.0, 1.0])
    np.testing.assert_allclose(found.carry((mesh.V @ slope)[mesh.F]), points @ slope, atol=1e-12)
    np.testing.assert_allclose(found.carry(mesh.V[mesh.F].tolist()), points)
    np.testing.assert_allclose(found.carry(np.ones((len(mesh.F), 3))), 1)
    # map coordinates are the sphere map carried along
    np.testing.assert_allclose(found.coordinates, points, atol=1e-12)


@pytest.mark.parametrize("topology", [cube_topology(4), square(4).topology])
def test_a_layer_with_halo_is_read_at_the_place_that_the_documentation_gives(topology) -> None:
    charts, n, _ = topology.shape
    rng = np.random.default_rng(0)
    chart = rng.integers(0, charts, 200)
    uv = rng.uniform(0, 1, (200, 2))
    # in a corner of three charts, halo and matrix differ but at the corner itself
    uv[:, 0] = uv[:, 0].clip(0.5 / n, 1 - 0.5 / n)
    field = rng.standard_normal(topology.shape)
    around = with_filled_halo(topology, field)
    # as a GPU filters: texel centres at halves
    column, row = ((1 + n * uv) / (n + 2) * (n + 2) - 0.5).T
    c = np.floor(column).astype(int)
    r = np.floor(row).astype(int)
    t = column - c
    s = row - r
    read = (1 - s) * ((1 - t) * around[chart, r, c] + t * around[chart, r, c + 1])
    read += s * ((1 - t) * around[chart, r + 1, c] + t * around[chart, r + 1, c + 1])
    np.testing.assert_allclose(
        read, sampling_matrix(topology, chart, *(n * uv[:, ::-1].T - 0.5)) @ field.ravel()
    )


# two triangles far apart and skewed, each on a chart of its own
V = np.array([[0.0, 0, 0], [2, 0, 1], [0, 3, 0], [5, 5, 5], [6, 5, 5], [5, 5, 9]])
MESH = Mesh(V, np.array([[0, 1, 2], [3, 4, 5]]))
CORNERS = np.array([[[-0.5, -0.5], [-0.5, 3.5], [3.5, 3.5]], [[0.0, 1], [2, 0], [1, 3]]])
MAP = LinearChartMap(np.array([2, 0]), CORNERS, 4)


def test_points_keep_their_barycentrics_on_the_chart() -> None:
    rng = np.random.default_rng(0)
    triangles = rng.integers(0, 2, 100)
    weights = rng.dirichlet(np.ones(3), 100)
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
    # on the plane of the first triangle, whose corners are at the corners of chart 2; the second is
    # on chart 0
    points = [V[0], V[1], V[2], V[:3].mean(axis=0), 2 * V[2] - V[0]]
    texels = MAP.texels_at(MESH, 4, *ClosestPoints(V, MESH.F)(np.array(points)))
    assert texels.tolist() == [2 * 16, 2 * 16 + 3, 2 * 16 + 15, 2 * 16 + 4 + 2, 2 * 16 + 15]


@pytest.mark.parametrize("texels", [square(4), polygon(5, 4)])
def test_the_nearest_texel_is_the_one_whose_centre_is_nearest(texels) -> None:
    atlas = texel_atlas(texels)
    rng = np.random.default_rng(2)
    # within a quarter of a texel's width, in the plane
    near = rng.integers(0, texels.topology.texel_count, 100)
    width = np.sqrt(texels.areas.min())
    offset = np.concatenate([rng.uniform(-0.2, 0.2, (100, 2)) * width, np.zeros((100, 1))], axis=1)
    np.testing.assert_array_equal(
        atlas.nearest_texel(texels.positions.reshape(-1, 3)[near] + offset), near
    )


def limbed_atlas(layout: str) -> Atlas:
    return build_atlas(Mesh.from_arrays(*limbed(0.05)), 12, layout=layout, cache=False)


ATLASES: dict[str, Callable[[], Atlas]] = {
    "cube": lambda: limbed_atlas("cube"),
    "patches": lambda: limbed_atlas("patches"),
    "given": lambda: texel_atlas(polygon(5, 8)),
    "sphere": lambda: sphere_atlas(0.7, 9),
}


@pytest.mark.parametrize("layout", ATLASES)
def test_places_are_those_of_points_carried_to_the_charts(layout: str) -> None:
    atlas = ATLASES[layout]()
    rng = np.random.default_rng(0)
    n = atlas.resolution
    size = np.ptp(atlas.mesh.V, axis=0).max()
    points = atlas.mesh.V[
        rng.integers(len(atlas.mesh.V), size=400)
    ] + 0.02 * size * rng.standard_normal((400, 3))
    closest, texels = atlas.nearest_places(points)
    np.testing.assert_allclose(closest, atlas.project(points)[0], atol=1e-12)
    np.testing.assert_array_equal(atlas.closest_places(points), closest)
    chart, row, column = atlas.locate(points)
    places = np.clip([row, column], 0, n - 1)
    found = np.array(np.unravel_index(texels, atlas.areas.shape))
    np.testing.assert_array_equal(found[0], chart)
    # half-way between two texels either will do
    assert np.abs(found[1:] - places).max() < 0.5 + 1e-9
