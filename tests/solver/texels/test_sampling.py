"""Bilinear sampling between texels: exact where it should be, and without a jump from chart to chart."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square

from ripple_sim.solver.layouts.cube.convention import cube_topology
from ripple_sim.solver.texels.topology import sampling_matrix


def at_side(side: int, along: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of places on a side of a chart, 0 to 1 from its first corner to its second."""
    low, high, there = np.full_like(along, -0.5), np.full_like(along, n - 0.5), n * along - 0.5
    return ((low, there), (there, high), (high, there[::-1]), (there[::-1], low))[side]


@pytest.mark.parametrize("topology", [cube_topology(4), polygon(3, 4).topology, polygon(4, 4).topology])
def test_both_charts_agree_along_a_glued_side_up_to_its_corners(topology) -> None:
    n = topology.shape[1]
    field = np.random.default_rng(0).standard_normal(topology.texel_count)
    along = np.linspace(0, 1, 41)
    for chart, side in np.argwhere(topology.glued[..., 0] >= 0):
        other, back = topology.glued[chart, side]
        here = sampling_matrix(topology, np.full(41, chart), *at_side(side, along, n)) @ field
        there = sampling_matrix(topology, np.full(41, other), *at_side(back, along, n)) @ field
        np.testing.assert_allclose(here, there[::-1], atol=1e-12)


def test_texel_centres_take_their_own_texel_alone() -> None:
    topology = cube_topology(4)
    chart, row, column = (each.ravel() for each in np.indices(topology.shape))
    matrix = sampling_matrix(topology, chart, row.astype(float), column.astype(float))
    np.testing.assert_array_equal(matrix.toarray(), np.eye(topology.texel_count))


@pytest.mark.parametrize("topology", [cube_topology(4), flat_torus(4).topology, polygon(5, 4).topology])
def test_weights_are_a_mean_of_at_most_four_texels(topology) -> None:
    rng = np.random.default_rng(1)
    chart = rng.integers(0, topology.shape[0], 500)
    matrix = sampling_matrix(topology, chart, *rng.uniform(-0.5, 3.5, (2, 500)))
    dense = matrix.toarray()
    assert dense.min() >= 0
    np.testing.assert_allclose(dense.sum(axis=1), 1)
    assert (np.count_nonzero(dense, axis=1) <= 4).all()


def test_a_bilinear_field_is_reproduced_inside_a_chart() -> None:
    topology = square(6).topology
    row, column = np.random.default_rng(2).uniform(0, 5, (2, 200))
    r, c = np.indices((6, 6))
    matrix = sampling_matrix(topology, np.zeros(200, np.int64), row, column)
    expected = 2 + 3 * row - column + 0.5 * row * column
    np.testing.assert_allclose(matrix @ (2 + 3 * r - c + 0.5 * r * c).ravel(), expected)


def test_up_to_a_rim_the_last_texels_go_on() -> None:
    topology = square(4).topology
    field = np.random.default_rng(3).standard_normal((4, 4))
    place = np.array([0.0, 1.0, 3.0])
    matrix = sampling_matrix(topology, np.zeros(3, np.int64), np.full(3, 3.5), place)
    np.testing.assert_allclose(matrix @ field.ravel(), field[3, [0, 1, 3]])
    corner = sampling_matrix(topology, np.zeros(1, np.int64), np.array([-0.5]), np.array([3.5]))
    np.testing.assert_allclose(corner @ field.ravel(), field[0, 3])


def test_a_corner_of_three_charts_is_the_mean_of_its_texels() -> None:
    topology = polygon(3, 4).topology
    matrix = sampling_matrix(topology, np.arange(3), np.full(3, -0.5), np.full(3, -0.5)).toarray()
    expected = np.zeros(48)
    expected[[0, 16, 32]] = 1 / 3
    np.testing.assert_allclose(matrix, np.tile(expected, (3, 1)))


def test_no_points_make_an_empty_matrix() -> None:
    none = np.zeros(0)
    assert sampling_matrix(cube_topology(4), none.astype(np.int64), none, none).shape == (0, 96)
