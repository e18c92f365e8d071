"""Sizes of cells: small on limbs, so that the map onto the charts wraps these without a fold among the texels."""

import numpy as np
from surfaces import sphere

from ripple_sim.solver import Mesh
from ripple_sim.solver.layouts.patches.atlas import patch_atlas
from ripple_sim.solver.layouts.patches.cells import Metric, cell_sizes
from ripple_sim.solver.layouts.patches.surface import Surface

TIPS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)


def ball_with_limbs(length: float, sharpness: float, level: int) -> Mesh:
    ball = sphere(level)
    radius = 1 + length * np.exp(sharpness * (ball.V @ TIPS.T - 1)).sum(axis=1)
    return Mesh.from_arrays(ball.V * radius[:, None], ball.F)


def test_cells_are_small_at_the_ends_of_limbs() -> None:
    mesh = ball_with_limbs(3.0, 40.0, 3)
    sizes = cell_sizes(Metric.of(Surface.of(mesh.V, mesh.F)), 0.5, (0.0, np.inf))
    away = np.linalg.norm(mesh.V, axis=1)
    assert np.median(sizes[away > 3]) < 0.7 * np.median(sizes[away < 1.2])


def test_sizes_keep_to_their_bounds() -> None:
    ball = sphere(3)
    sizes = cell_sizes(Metric.of(Surface.of(ball.V, ball.F)), 0.5, (0.2, 0.3))
    assert sizes.min() >= 0.2
    assert sizes.max() <= 0.3 + 1e-12


def test_texels_on_limbs_are_neither_folded_nor_wide() -> None:
    atlas = patch_atlas(ball_with_limbs(3.0, 40.0, 4), 64)
    quality = atlas.quality()
    assert quality["folded"] == 0
    assert quality["timestep"] > 0.5
    assert np.quantile(atlas.areas, 0.999) < 3 * np.median(atlas.areas)
