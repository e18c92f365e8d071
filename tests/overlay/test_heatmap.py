"""A heatmap's texels, its range and the grid."""

import numpy as np
import pytest

from ripple_sim.overlay.notes import grid_spacing, magnitude
from ripple_sim.solver import HeightMap, sphere_atlas
from ripple_sim.solver.texels.topology import with_filled_halo


def test_padding_is_that_of_a_height_map() -> None:
    atlas = sphere_atlas(1.0, 12)
    field = np.random.default_rng(0).standard_normal((6, 12, 12)).astype(np.float32)
    around = with_filled_halo(atlas.texels.topology, field)
    np.testing.assert_allclose(around, HeightMap(atlas.texels)(field)[..., 3], rtol=1e-6)


def test_magnitude_is_that_of_waves_where_they_are() -> None:
    field = np.zeros((6, 42, 42), np.float32)
    assert magnitude(field) == 0
    field[0, 10:20, 10:20] = -0.2
    assert magnitude(field) == pytest.approx(0.2)  # however calm the rest is
    field[1:4] = 0.1
    assert magnitude(field) == pytest.approx((100 * 0.04 + 4800 * 0.01) / (100 * 0.2 + 4800 * 0.1))


def test_grid_has_a_readable_number_of_cells() -> None:
    assert [grid_spacing(n) for n in (8, 16, 24, 32, 96, 128, 256)] == [1, 1, 1, 2, 4, 8, 16]
