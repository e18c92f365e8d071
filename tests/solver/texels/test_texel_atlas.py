"""Atlases of texel meshes without a triangle mesh."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square

from ripple_sim.solver import texel_atlas


def test_points_find_their_texels() -> None:
    for texels in (square(6), polygon(5, 6), polygon(3, 4), flat_torus(6)):
        atlas = texel_atlas(texels)
        assert atlas.mesh.area == pytest.approx(texels.areas.sum())
        found = atlas.nearest_texel(texels.positions.reshape(-1, 3))
        np.testing.assert_array_equal(found, np.arange(texels.topology.texel_count))
        chart, row, column = atlas.locate(texels.positions[0, 1, :3])
        assert (chart == 0).all()
        np.testing.assert_allclose(row, 1, atol=1e-9)
        np.testing.assert_allclose(column, [0, 1, 2], atol=1e-9)
