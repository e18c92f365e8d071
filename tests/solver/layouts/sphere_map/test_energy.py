"""The energy of a sphere map against singular values, and its derivatives against differences.

The projected Hessian of a triangle's energy against the eigenvalues of the full one.

Vectors as tuples against numpy, and the tangent frame everywhere on the sphere.
"""

import numpy as np
import pytest
from levels import crumpled, icosphere, whole_level

from ripple_sim.solver.layouts.sphere_map.energy import (
    combine,
    cross,
    density,
    density_derivatives,
    dot,
    projected_hessian,
    row,
    set_row,
    subtract,
    tangent_frame,
    total_energy,
    unit,
)

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


# det of the 2 x 2 map (p, q; r, s) is p s - q r: its second derivative
SECOND_OF_J = np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]], dtype=float)
SECOND_OF_D = 2 * np.eye(4)


def gradients(A):
    p, q, r, s = A.ravel()
    return 2 * A.ravel(), np.array([s, -r, -q, p])


def full_hessian(A):
    _, wd, wj, wdd, wdj, wjj = density_derivatives(np.sum(A * A), np.linalg.det(A))
    gd, gj = gradients(A)
    mixed = np.outer(gd, gj)
    squares = wdd * np.outer(gd, gd) + wdj * (mixed + mixed.T) + wjj * np.outer(gj, gj)
    return wd * SECOND_OF_D + wj * SECOND_OF_J + squares


def positive_part(H):
    values, vectors = np.linalg.eigh(H)
    return (vectors * np.maximum(values, 0)) @ vectors.T


def rotated(s1, s2):
    turn = [np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]]) for t in (0.4, -1.1)]
    return turn[0] @ np.diag([s1, s2]) @ turn[1]


@pytest.mark.parametrize(
    ("s1", "s2"), [(1, 1), (1.1, 0.9), (2, 2), (0.3, 0.3), (2, 0.5), (0.6, 0.4), (0.5, 0.1), (3, 0.01), (1.5, 1.4)]
)
@pytest.mark.parametrize("area", [1.0, 0.01])
def test_projected_hessian_is_the_positive_part_of_the_full_one(s1, s2, area):
    A = rotated(s1, s2)
    energy, shares = projected_hessian(area, np.sum(A * A), np.linalg.det(A))
    w, wd, wj, *_ = density_derivatives(np.sum(A * A), np.linalg.det(A))
    np.testing.assert_allclose([energy, *shares[:2]], area * np.array([w, wd, wj]), rtol=1e-12)
    bend_d, bend_j, dd, dj, jj = shares[2:]
    gd, gj = gradients(A)
    mixed = np.outer(gd, gj)
    H = bend_d * SECOND_OF_D + bend_j * SECOND_OF_J + dd * np.outer(gd, gd) + dj * (mixed + mixed.T)
    H += jj * np.outer(gj, gj)
    expected = area * positive_part(full_hessian(A))
    np.testing.assert_allclose(H, expected, atol=1e-8 * np.abs(expected).max())


def test_some_hessians_have_a_negative_part_to_lose():
    lows = [np.linalg.eigvalsh(full_hessian(rotated(*s)))[0] for s in ((0.6, 0.4), (0.3, 0.3), (2, 0.5))]
    assert min(lows) < 0


AXES = [tuple(sign * each) for each in np.eye(3) for sign in (1.0, -1.0)]
# the frame changes its recipe where |x| = 0.6
BORDER = [(x, 0.0, np.sqrt(1 - x * x)) for x in (0.6, np.nextafter(0.6, 0), np.nextafter(0.6, 1), -0.6)]
RANDOM = [tuple(each / np.linalg.norm(each)) for each in np.random.default_rng(0).standard_normal((10, 3))]


@pytest.mark.parametrize("p", [*AXES, *BORDER, *RANDOM])
def test_tangent_frame_is_orthonormal_and_right_handed(p):
    x, y = tangent_frame(p)
    frame = np.array([x, y, p])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame) == pytest.approx(1, abs=1e-14)


def test_vector_algebra_agrees_with_numpy():
    for a, b in np.random.default_rng(1).standard_normal((5, 2, 3)):
        np.testing.assert_array_equal(subtract(tuple(a), tuple(b)), a - b)
        np.testing.assert_allclose(dot(tuple(a), tuple(b)), a @ b, rtol=1e-13)
        np.testing.assert_allclose(cross(tuple(a), tuple(b)), np.cross(a, b), rtol=1e-13)
        np.testing.assert_allclose(combine(2.0, tuple(a), -0.5, tuple(b)), 2 * a - b / 2, rtol=1e-13)


@pytest.mark.parametrize("length", [1e-100, 1e-3, 1.0, 1e100])
def test_unit_keeps_the_direction_of_vectors_of_any_length(length):
    direction = np.array([2.0, -1.0, 2.0]) / 3
    np.testing.assert_allclose(unit(tuple(length * direction)), direction, rtol=1e-15)


def test_unit_leaves_the_zero_vector_as_it_is():
    assert unit((0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)


def test_writing_a_row_changes_no_other_row():
    array = np.arange(12.0).reshape(4, 3)
    expected = array.copy()
    expected[2] = expected[1]
    set_row(array, 2, row(array, 1))
    np.testing.assert_array_equal(array, expected)
