"""Atlases that tests of texels share."""

import numpy as np
import pytest

from ripple_sim.solver.layouts.cube import cube_topology, texel_directions
from ripple_sim.solver.texels import TexelMesh


@pytest.fixture(scope="module")
def bumpy() -> TexelMesh:
    """Star-shaped surface without symmetry."""
    d = texel_directions(6)
    rng = np.random.default_rng(3)
    return TexelMesh.of(
        cube_topology(6),
        d * (1 + 0.3 * np.sin(d @ rng.uniform(1, 3, 3))[..., None]) * [1.0, 0.7, 1.3],
    )
