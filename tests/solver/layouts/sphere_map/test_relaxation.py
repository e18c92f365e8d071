"""Relaxing a level brings it from any fold-free map to the minimum of its energy."""

import numpy as np
import pytest
from genus_zero import crumpled, icosphere
from levels import whole_level

from ripple_sim.solver.layouts.sphere_map import certify
from ripple_sim.solver.layouts.sphere_map.progressive import newton_step, relax_level, total_energy


def perturbed(V):
    S = V + 0.03 * np.random.default_rng(2).standard_normal(V.shape)
    return S / np.linalg.norm(S, axis=1)[:, None]


def squeezed(V):
    """A conformal map that draws the sphere towards its north pole."""
    x, y, z = V.T
    factor = 0.2 * np.sqrt((1 - z) / (1 + z).clip(1e-12))  # tan of half the new polar angle
    bottom = z < -1 + 1e-9
    t = np.where(bottom, 1e6, factor)
    planar = np.stack([x, y], axis=1) / np.hypot(x, y).clip(1e-12)[:, None]
    return np.column_stack([planar * (2 * t / (1 + t * t))[:, None], (1 - t * t) / (1 + t * t)])


@pytest.mark.parametrize("start", [perturbed, squeezed])
def test_a_sphere_comes_back_to_its_own_shape(start):
    V, F = icosphere(2)
    level, reference = whole_level(V, F)
    S = start(V)
    least = total_energy(level.tail, V, reference)
    assert certify(F, S).valid and total_energy(level.tail, S, reference) > 1.05 * least
    relax_level(level, S, reference)
    assert total_energy(level.tail, S, reference) < 1.01 * least
    assert certify(F, S).valid
    np.testing.assert_allclose(S @ S.T, V @ V.T, atol=0.1)  # the same but for a rotation


def test_relaxing_again_gains_next_to_nothing():
    V, F = crumpled()
    level, reference = whole_level(V, F)
    S = icosphere(3)[0]
    energies = [total_energy(level.tail, S, reference)]
    for _ in range(2):
        relax_level(level, S, reference)
        energies.append(total_energy(level.tail, S, reference))
    assert energies[1] < 0.5 * energies[0]
    assert 0.9 * energies[1] < energies[2] <= energies[1]
    assert certify(F, S).valid
    np.testing.assert_allclose(np.linalg.norm(S, axis=1), 1, atol=1e-12)


def test_a_folded_map_is_left_as_it_is():
    V, F = icosphere(1)
    level, reference = whole_level(V, F)
    S = -V
    relax_level(level, S, reference)
    np.testing.assert_array_equal(S, -V)


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
