"""The energy's gradient and Hessian against differences of the energy.

Newton steps reach the minimum.
"""

import numpy as np
import pytest
from levels import assembled, crumpled, icosphere, whole_level

from ripple_sim.solver.layouts.sphere_map.energy import total_energy
from ripple_sim.solver.layouts.sphere_map.hessian import newton_step


def test_newton_gradient_is_the_slope_of_the_energy():
    V, F = crumpled()
    level, reference = whole_level(V, F)
    S = icosphere(3)[0]
    frames, gradient, *_ = assembled(level, S, reference)
    direction = np.random.default_rng(1).standard_normal(gradient.shape)
    velocity = np.einsum("ni,nij->nj", direction, frames)
    ahead, behind = ((S + t * velocity) / np.linalg.norm(S + t * velocity, axis=1)[:, None] for t in (1e-6, -1e-6))
    slope = (total_energy(level.tail, ahead, reference) - total_energy(level.tail, behind, reference)) / 2e-6
    assert slope == pytest.approx(np.sum(gradient * direction), rel=1e-5)


def test_newton_hessian_is_positive_and_second_order_near_the_minimum():
    V, F = icosphere(2)
    level, reference = whole_level(V, F)
    frames, _, _, _, H = assembled(level, V, reference)
    np.testing.assert_array_equal(H, H.T)
    eigenvalues = np.linalg.eigvalsh(H)
    assert eigenvalues[0] > -1e-9 * eigenvalues[-1]
    # a small bump of one vertex: the energy rises as the quadratic form says
    direction = np.zeros((len(V), 2))
    direction[20] = [0.6, 0.8]
    velocity = np.einsum("ni,nij->nj", direction, frames)
    rise = []
    for t in (1e-4, -1e-4):
        S = V + t * velocity
        S /= np.linalg.norm(S, axis=1)[:, None]
        rise.append(total_energy(level.tail, S, reference) - total_energy(level.tail, V, reference))
    assert sum(rise) / 1e-8 == pytest.approx(direction.ravel() @ H @ direction.ravel(), rel=0.05)


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
