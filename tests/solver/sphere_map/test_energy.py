"""The energy of a sphere map against singular values, and its derivatives against differences."""

import numpy as np
import pytest
from levels import crumpled, icosphere, whole_level

from ripple_sim.solver.layouts.sphere_map.energy import density, density_derivatives, total_energy

# Dirichlet energy and area ratio of maps that shrink, keep and stretch, evenly and not
STRETCHES = [(2.0, 1.0), (2.5, 1.0), (0.7, 0.3), (0.5, 0.25), (1.2, 0.1), (9.0, 4.0)]


@pytest.mark.parametrize(("d", "j"), STRETCHES)
def test_derivatives_of_the_density_are_those_of_differences(d, j):
    def w(d, j):
        return density(d, 1 / j)

    e, f = 1e-5 * d, 1e-5 * j
    value, *slopes = density_derivatives(d, j)
    assert value == pytest.approx(w(d, j), rel=1e-13)
    np.testing.assert_allclose(slopes[0], (w(d + e, j) - w(d - e, j)) / (2 * e), rtol=1e-6)
    np.testing.assert_allclose(slopes[1], (w(d, j + f) - w(d, j - f)) / (2 * f), rtol=1e-4)
    along_d = np.subtract(density_derivatives(d + e, j), density_derivatives(d - e, j))[1:3] / (2 * e)
    along_j = np.subtract(density_derivatives(d, j + f), density_derivatives(d, j - f))[1:3] / (2 * f)
    np.testing.assert_allclose(slopes[2:], [*along_d, along_j[1]], rtol=1e-5)
    assert along_d[1] == pytest.approx(along_j[0], rel=1e-5)


def test_an_even_map_of_the_right_size_costs_less_than_any_uneven_one_of_the_same_area():
    stretch = np.array([0.5, 0.8, 0.95, 1.05, 1.25, 2.0])
    even = density(2.0, 1.0)
    assert all(density(s**2 + s**-2, 1.0) > even for s in stretch)


def test_small_areas_meet_a_wall_of_the_sixteenth_power():
    assert density(2.0, 1 / 0.005) / density(2.0, 1 / 0.01) == pytest.approx(2**16, rel=1e-3)
    assert density(2.0, 1 / 0.7) < 1.2 * density(2.0, 1.0)  # moderate losses are almost free


def singular_values(triangle, image):
    """Of the linear map from one triangle [3, 3] in space to another."""

    def flat(corners):
        e, f = corners[1] - corners[0], corners[2] - corners[0]
        x = e / np.linalg.norm(e)
        y = f - (f @ x) * x
        y /= np.linalg.norm(y)
        return np.array([[e @ x, f @ x], [e @ y, f @ y]])

    return np.linalg.svd(flat(image) @ np.linalg.inv(flat(triangle)), compute_uv=False)


def test_energy_is_that_of_the_singular_values_of_every_triangle():
    V, F = crumpled()
    level, reference = whole_level(V, F)
    S = icosphere(3)[0]
    total = 0.0
    for f, (i, j, k) in enumerate(F):
        dirichlet = np.sum(singular_values(V[[i, j, k]], S[[i, j, k]]) ** 2)
        ratio = np.linalg.det(S[[i, j, k]]) / (2 * reference.area[f])
        total += reference.area[f] * density(dirichlet, 1 / ratio)
    assert total_energy(level.tail, S, reference) == pytest.approx(total, rel=1e-9)


def test_energy_does_not_change_under_rotation_of_the_sphere():
    V, F = crumpled()
    level, reference = whole_level(V, F)
    S = icosphere(3)[0]
    rotation = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    before = total_energy(level.tail, S, reference)
    assert total_energy(level.tail, S @ rotation.T, reference) == pytest.approx(before, rel=1e-10)
    assert total_energy(level.tail, -S @ rotation.T, reference) == np.inf  # a mirror image is all folds


@pytest.mark.parametrize("place", ["beyond its star", "on its neighbour", "not a number"])
def test_energy_of_a_folded_map_is_infinite(place):
    V, F = icosphere(2)
    level, reference = whole_level(V, F)
    assert np.isfinite(total_energy(level.tail, V, reference))
    S = V.copy()
    S[0] = {"beyond its star": -V[0], "on its neighbour": V[level.ring[0]], "not a number": np.full(3, np.nan)}[place]
    assert total_energy(level.tail, S, reference) == np.inf
