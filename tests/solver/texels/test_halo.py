"""Fields with halo: wrapped, repeated, and continuous where three charts meet."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square

from ripple_sim.solver.layouts.cube.convention import cube_topology
from ripple_sim.solver.texels.topology import fill_halo, with_filled_halo


def noise(*shape: int) -> np.ndarray:
    return np.random.default_rng(0).standard_normal(shape).astype(np.float32)


@pytest.mark.parametrize(("topology", "mode"), [(flat_torus(5).topology, "wrap"), (square(5).topology, "edge")])
def test_a_torus_goes_round_and_a_rim_repeats_the_last_texels(topology, mode: str) -> None:
    field = noise(1, 5, 5)
    np.testing.assert_array_equal(with_filled_halo(topology, field)[0], np.pad(field[0], 1, mode=mode))


def at_corners(around: np.ndarray) -> np.ndarray:
    """Bilinear interpolation at the four corners of each chart, [C, 4]."""
    last = around.shape[1] - 2
    return np.stack(
        [around[:, r : r + 2, c : c + 2].mean(axis=(1, 2)) for r, c in ((0, 0), (0, last), (last, last), (last, 0))],
        axis=1,
    )


@pytest.mark.parametrize("topology", [cube_topology(4), polygon(3, 4).topology, polygon(4, 4).topology])
def test_charts_that_meet_in_a_corner_agree_on_its_value(topology) -> None:
    around = with_filled_halo(topology, noise(*topology.shape)).astype(np.float64)
    values, inner = at_corners(around), topology.valence > 0
    for point in np.unique(topology.corners[inner]):
        here = values[topology.corners == point]
        assert len(here) >= 3
        np.testing.assert_allclose(here, here[0], atol=1e-6)


def test_a_missing_corner_is_the_mean_of_the_three_texels_round_it() -> None:
    topology = polygon(3, 4).topology
    field = noise(3, 4, 4)
    np.testing.assert_allclose(with_filled_halo(topology, field)[:, 0, 0], field[:, 0, 0].mean(), rtol=1e-5)


def test_constants_stay_constant_even_in_corners_of_five_charts() -> None:
    for topology in (polygon(5, 4).topology, cube_topology(4)):
        np.testing.assert_allclose(with_filled_halo(topology, np.full(topology.shape, 2.5, np.float32)), 2.5)


def test_filling_replaces_an_old_halo_and_keeps_the_texels() -> None:
    topology = cube_topology(4)
    field = noise(6, 4, 4)
    around = np.full((6, 6, 6), np.nan, np.float32)
    around[:, 1:-1, 1:-1] = field
    fill_halo(topology, around)
    np.testing.assert_array_equal(around[:, 1:-1, 1:-1], field)
    np.testing.assert_array_equal(around, with_filled_halo(topology, field))
    assert around.dtype == np.float32


def test_components_of_a_vector_field_are_filled_one_by_one() -> None:
    topology = cube_topology(4)
    field = noise(6, 4, 4, 3)
    around = with_filled_halo(topology, field)
    for k in range(3):
        np.testing.assert_array_equal(around[..., k], with_filled_halo(topology, field[..., k]))
