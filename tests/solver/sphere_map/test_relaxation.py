"""Sweeps lower the energy."""

import numpy as np
import pytest
from levels import crumpled, icosphere, whole_level

from ripple_sim.solver.layouts.sphere_map.energy import total_energy
from ripple_sim.solver.layouts.sphere_map.level import star_shapes
from ripple_sim.solver.layouts.sphere_map.relaxation import sweep


@pytest.mark.parametrize("backwards", [False, True])
def test_a_sweep_lowers_the_energy_by_what_it_says(backwards):
    V, F = crumpled()
    level, reference = whole_level(V, F)
    S = icosphere(3)[0]
    before = total_energy(level.tail, S, reference)
    fall = sweep(level, S, star_shapes(level.star, reference), backwards)
    assert fall > 0.1 * before
    assert total_energy(level.tail, S, reference) == pytest.approx(before - fall, rel=1e-9)
    np.testing.assert_allclose(np.linalg.norm(S, axis=1), 1, atol=1e-14)
