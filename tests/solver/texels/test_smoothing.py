"""Smoothing by passes of 1 2 1: its frequency response, its width, and its symmetry."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square

from ripple_sim.solver.layouts.cube.convention import cube_rotations, cube_topology, permute_texels
from ripple_sim.solver.texels.texel_mesh import smoothed


@pytest.mark.parametrize(("k", "m"), [(0, 0), (1, 0), (2, 3), (6, 6)])
def test_waves_on_a_torus_fade_as_cos_to_the_eighth_of_half_their_phase(k: int, m: int) -> None:
    n = 12
    row, column = np.indices((n, n))
    wave = np.cos(2 * np.pi * (k * column + m * row) / n)[None]
    # one pass of 1 2 1 over 4 is cos^2 of half the phase from texel to texel
    response = (np.cos(np.pi * k / n) * np.cos(np.pi * m / n)) ** 8
    np.testing.assert_allclose(smoothed(flat_torus(n).topology, wave), response * wave, atol=1e-12)


def test_a_point_spreads_with_a_standard_deviation_of_root_2_and_keeps_its_sum() -> None:
    field = np.zeros((1, 16, 16))
    field[0, 8, 8] = 1
    spread = smoothed(flat_torus(16).topology, field)[0]
    assert spread.sum() == pytest.approx(1)
    offset = np.arange(16) - 8
    for axis in (0, 1):
        assert spread.sum(axis=axis) @ offset**2 == pytest.approx(2)
    assert np.count_nonzero(spread) == 81


@pytest.mark.parametrize(
    "topology", [cube_topology(4), square(4).topology, polygon(3, 4).topology, polygon(5, 4).topology]
)
def test_constants_stay_and_nothing_leaves_its_range(topology) -> None:
    np.testing.assert_allclose(smoothed(topology, np.full(topology.shape, 7.0)), 7)
    field = np.random.default_rng(0).uniform(-1, 2, topology.shape)
    found = smoothed(topology, field)
    assert field.min() < found.min() < found.max() < field.max()


def test_smoothing_does_not_know_how_the_cube_is_turned() -> None:
    topology = cube_topology(6)
    field = np.random.default_rng(1).standard_normal((6, 6, 6))
    found = smoothed(topology, field)
    for rotation in cube_rotations():
        np.testing.assert_allclose(
            smoothed(topology, permute_texels(field, rotation)), permute_texels(found, rotation), atol=1e-14
        )


def test_the_field_itself_is_left_alone() -> None:
    field = np.random.default_rng(2).standard_normal((6, 4, 4))
    before = field.copy()
    smoothed(cube_topology(4), field)
    np.testing.assert_array_equal(field, before)
