"""Newton steps reach the minimum."""

import numpy as np
from levels import icosphere, whole_level

from ripple_sim.solver.layouts.sphere_map.energy import total_energy
from ripple_sim.solver.layouts.sphere_map.hessian import newton_step


def test_newton_steps_reach_the_minimum_of_a_perturbed_sphere():
    V, F = icosphere(3)
    level, reference = whole_level(V, F)
    S = V + 0.015 * np.random.default_rng(2).standard_normal(V.shape)
    S /= np.linalg.norm(S, axis=1)[:, None]
    least = total_energy(level.tail, V, reference)
    assert total_energy(level.tail, S, reference) > 1.05 * least
    for _ in range(8):
        newton_step(level, S, reference, 60)
    assert total_energy(level.tail, S, reference) < (1 + 1e-4) * least
