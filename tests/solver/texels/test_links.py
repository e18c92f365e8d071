"""The links' lengths."""

import numpy as np

from ripple_sim.solver import sphere_atlas
from ripple_sim.solver.texels.stencil import link_lengths


def test_link_lengths_are_distances_between_neighbours() -> None:
    atlas = sphere_atlas(2.0, 12)
    lengths = link_lengths(atlas.texels.topology, atlas.texels.halo_positions)[:, :2]
    ideal = 2.0 * np.pi / 2 / 12
    finite = lengths[np.isfinite(lengths) & (lengths > 0)] / ideal
    # equiangular cells are as wide as ideal ones on a face's middle lines and narrowest beside the cube's edges
    assert 0.7 < finite.min() < 0.8
    assert 0.99 < finite.max() <= 1.0
