"""Conjugate gradients solve the Newton system."""

import numpy as np
from levels import assembled, crumpled, icosphere, whole_level

from ripple_sim.solver.layouts.conjugate_gradients import solve


def test_conjugate_gradients_solve_the_newton_system():
    V, F = crumpled()
    level, reference = whole_level(V, F)
    _, gradient, diagonal, blocks, H = assembled(level, icosphere(3)[0], reference)
    step = solve(level.ends, diagonal, blocks, gradient, 5000, 1e-10)
    np.testing.assert_allclose(H @ step.ravel(), -gradient.ravel(), atol=1e-6 * np.abs(gradient).max())
