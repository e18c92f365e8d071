"""The projected Hessian of a triangle's energy against the eigenvalues of the full one."""

import numpy as np
import pytest

from ripple_sim.solver.layouts.sphere_map.energy import density_derivatives, projected_hessian

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
