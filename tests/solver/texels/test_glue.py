"""Charts glued along their sides."""

import numpy as np
import pytest
from hand_made import eigenvalues, polygon, square, two_squares

from ripple_sim.solver import AtlasError, Material, TexelMesh, WaveSolver, glue, texel_atlas


def test_charts_side_by_side_are_one_chart() -> None:
    whole, parts = square(12), polygon(4, 6)
    # the same square, turned by an eighth and 2 ** 0.5 as wide
    np.testing.assert_allclose(eigenvalues(parts, 12), eigenvalues(whole, 12) / 2, rtol=1e-9, atol=1e-9)


def test_waves_stay_in_their_part() -> None:
    waves = WaveSolver(texel_atlas(two_squares(16)), Material(speed=1.0), backend="cpu", conserve_volume=False)
    waves.add_impulse([0.5, 0.5, 1.0], 1.0, 0.2)
    waves.step(1.0)
    assert (waves.height[0] == 0).all()
    assert np.abs(waves.height[1]).max() > 0
    np.testing.assert_allclose(eigenvalues(two_squares(8), 4)[:2], 0, atol=1e-9)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(AtlasError, match="not glued back"):
        glue(np.array([[(0, 2), (0, 3), (0, 1), (0, 0)]]), 4)
    with pytest.raises(AtlasError, match=r"shape \(1, 4\); valid is"):
        glue(np.zeros((1, 4)), 4)
    with pytest.raises(AtlasError, match="texel positions have shape"):
        TexelMesh.of(square(4).topology, np.zeros((4, 4, 3)))
    with pytest.raises(AtlasError, match="not finite"):
        square(4).with_positions(np.full((1, 4, 4, 3), np.nan))
