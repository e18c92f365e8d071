"""The energy of maps against singular values, its derivatives against differences."""

import numpy as np
import pytest
from genus_zero import crumpled, icosphere
from levels import assembled, whole_level

from ripple_sim.solver.layouts import (
    TERMS,
    Density,
    density_derivatives,
    energy_density,
    expand_star,
    projected_hessian,
    star_energy,
    star_slopes,
    tangent_move,
)
from ripple_sim.solver.layouts.sphere_map import (
    SPHERE,
    star_shapes,
    sweep,
    tangent_frame,
    total_energy,
)

# Dirichlet energy and area ratio of maps that shrink, keep and stretch, evenly and not
STRETCHES = [(2.0, 1.0), (2.5, 1.0), (0.7, 0.3), (0.5, 0.25), (1.2, 0.1), (9.0, 4.0)]


@pytest.mark.parametrize("density", [SPHERE, Density(2, 0.5, 0.5, 0.0)], ids=["sphere", "charts"])
@pytest.mark.parametrize(("d", "j"), STRETCHES)
def test_derivatives_of_the_density_are_those_of_differences(density, d, j):
    def w(d, j):
        return energy_density(d, 1 / j, density)

    def derivatives(d, j):
        return density_derivatives(d, j, density)

    e = 1e-5 * d
    f = 1e-5 * j
    value, *slopes = derivatives(d, j)
    assert value == pytest.approx(w(d, j), rel=1e-13)
    np.testing.assert_allclose(slopes[0], (w(d + e, j) - w(d - e, j)) / (2 * e), rtol=1e-6)
    np.testing.assert_allclose(slopes[1], (w(d, j + f) - w(d, j - f)) / (2 * f), rtol=1e-4)
    along_d = np.subtract(derivatives(d + e, j), derivatives(d - e, j))[1:3] / (2 * e)
    along_j = np.subtract(derivatives(d, j + f), derivatives(d, j - f))[1:3] / (2 * f)
    np.testing.assert_allclose(slopes[2:], [*along_d, along_j[1]], rtol=1e-5)
    assert along_d[1] == pytest.approx(along_j[0], rel=1e-5)


def test_an_even_map_of_the_right_size_costs_less_than_any_uneven_one_of_the_same_area():
    stretch = np.array([0.5, 0.8, 0.95, 1.05, 1.25, 2.0])
    even = energy_density(2.0, 1.0, SPHERE)
    assert all(energy_density(s**2 + s**-2, 1.0, SPHERE) > even for s in stretch)


def test_small_areas_meet_a_wall_of_the_sixteenth_power():
    wall = [energy_density(2.0, 1 / j, SPHERE) for j in (0.005, 0.01)]
    assert wall[0] / wall[1] == pytest.approx(2**16, rel=1e-3)


@pytest.mark.parametrize("d, j", [(2.0, 0.7), (3.0, 1.3), (5.0, 0.2)])
def test_a_map_and_its_inverse_cost_the_same_without_the_wall(d: float, j: float):
    without = SPHERE._replace(small=0.0)
    assert energy_density(d, 1 / j, without) == pytest.approx(
        energy_density(d / j**2, j, without), rel=1e-13
    )


def singular_values(triangle, image):
    """Of the linear map from one triangle [3, 3] in space to another."""

    def flat(corners):
        e = corners[1] - corners[0]
        f = corners[2] - corners[0]
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
        total += reference.area[f] * energy_density(dirichlet, 1 / ratio, SPHERE)
    assert total_energy(level.tail, S, reference) == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize("place", ["beyond its star", "on its neighbour", "not a number"])
def test_energy_of_a_folded_map_is_infinite(place):
    V, F = icosphere(2)
    level, reference = whole_level(V, F)
    assert np.isfinite(total_energy(level.tail, V, reference))
    S = V.copy()
    S[0] = {
        "beyond its star": -V[0],
        "on its neighbour": V[level.ring[0]],
        "not a number": np.full(3, np.nan),
    }[place]
    assert total_energy(level.tail, S, reference) == np.inf


# det of the 2 x 2 map (p, q; r, s) is p s - q r: its second derivative
SECOND_OF_J = np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]], dtype=float)
SECOND_OF_D = 2 * np.eye(4)


def gradients(A):
    p, q, r, s = A.ravel()
    return 2 * A.ravel(), np.array([s, -r, -q, p])


@pytest.mark.parametrize(
    ("s1", "s2"),
    [
        (1, 1),
        (1.1, 0.9),
        (2, 2),
        (0.3, 0.3),
        (2, 0.5),
        (0.6, 0.4),
        (0.5, 0.1),
        (3, 0.01),
        (1.5, 1.4),
    ],
)
@pytest.mark.parametrize("area", [1.0, 0.01])
def test_projected_hessian_is_the_positive_part_of_the_full_one(s1, s2, area):
    turn = [np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]]) for t in (0.4, -1.1)]
    A = turn[0] @ np.diag([s1, s2]) @ turn[1]
    energy, shares = projected_hessian(area, np.sum(A * A), np.linalg.det(A), SPHERE)
    w, wd, wj, wdd, wdj, wjj = density_derivatives(np.sum(A * A), np.linalg.det(A), SPHERE)
    np.testing.assert_allclose([energy, *shares[:2]], area * np.array([w, wd, wj]), rtol=1e-12)
    bend_d, bend_j, dd, dj, jj = shares[2:]
    gd, gj = gradients(A)
    mixed = np.outer(gd, gj)
    H = bend_d * SECOND_OF_D + bend_j * SECOND_OF_J + dd * np.outer(gd, gd) + dj * (mixed + mixed.T)
    H += jj * np.outer(gj, gj)
    squares = wdd * np.outer(gd, gd) + wdj * (mixed + mixed.T) + wjj * np.outer(gj, gj)
    values, vectors = np.linalg.eigh(wd * SECOND_OF_D + wj * SECOND_OF_J + squares)
    expected = area * (vectors * np.maximum(values, 0)) @ vectors.T
    np.testing.assert_allclose(H, expected, atol=1e-8 * np.abs(expected).max())


AXES = [tuple(sign * each) for each in np.eye(3) for sign in (1.0, -1.0)]
# the frame changes its recipe where |x| = 0.6
BORDER = [
    (x, 0.0, np.sqrt(1 - x * x)) for x in (0.6, np.nextafter(0.6, 0), np.nextafter(0.6, 1), -0.6)
]
RANDOM = [
    tuple(each / np.linalg.norm(each)) for each in np.random.default_rng(0).standard_normal((10, 3))
]


@pytest.mark.parametrize("p", [*AXES, *BORDER, *RANDOM])
def test_tangent_frame_is_orthonormal_and_right_handed(p):
    x, y = tangent_frame(p)
    frame = np.array([x, y, p])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(frame) == pytest.approx(1, abs=1e-14)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_sweep_lowers_the_energy_by_the_returned_amount(backwards):
    V, F = crumpled()
    level, reference = whole_level(V, F)
    S = icosphere(3)[0]
    before = total_energy(level.tail, S, reference)
    fall = sweep(level, S, star_shapes(level.star, reference), SPHERE, backwards)
    assert fall > 0.1 * before
    assert total_energy(level.tail, S, reference) == pytest.approx(before - fall, rel=1e-9)
    np.testing.assert_allclose(np.linalg.norm(S, axis=1), 1, atol=1e-14)


def star_terms(level, S, reference, v):
    """What `expand_star` says of one vertex's star."""
    first = level.star_start[v]
    last = level.star_start[v + 1]
    x, y = tangent_frame(tuple(S[v]))
    terms = np.empty((last - first, TERMS))
    ring = S[level.ring[first:last]]
    shapes = star_shapes(level.star, reference)[first:last]
    expand_star(tuple(S[v]), x, y, ring, np.roll(ring, -1, axis=0), shapes, last - first, terms)
    return terms, np.array(x), np.array(y)


@pytest.mark.parametrize("v", [0, 5, 100])
def test_the_expanded_star_knows_the_energy_of_every_place(v):
    V, F = crumpled()
    level, reference = whole_level(V, F)
    S = icosphere(3)[0]
    terms, x, y = star_terms(level, S, reference, v)
    at_rest = total_energy(level.tail, S, reference)
    for a, b in np.random.default_rng(v).uniform(-0.05, 0.05, (10, 2)):
        move = tangent_move(a, b, 1.0)
        moved = S.copy()
        moved[v] += move[0] * x + move[1] * y + move[2] * S[v]
        assert np.linalg.norm(moved[v]) == pytest.approx(1, abs=1e-15)
        rise = star_energy(terms, len(terms), SPHERE, move) - star_energy(
            terms, len(terms), SPHERE, (0.0, 0.0, 0.0)
        )
        expected = total_energy(level.tail, moved, reference) - at_rest
        assert rise == pytest.approx(expected, rel=1e-6, abs=1e-11 * at_rest)


def test_slopes_of_the_expanded_star_are_those_of_its_energy():
    V, F = crumpled()
    level, reference = whole_level(V, F)
    terms, *_ = star_terms(level, icosphere(3)[0], reference, 7)
    degree = len(terms)
    h = 1e-4

    def at(a, b):
        return star_energy(terms, degree, SPHERE, tangent_move(a, b, 1.0))

    energy, gx, gy, hxx, hxy, hyy = star_slopes(terms, degree, SPHERE, 1.0)
    assert energy == pytest.approx(at(0.0, 0.0), rel=1e-14)
    assert [gx, gy] == pytest.approx(
        [(at(h, 0) - at(-h, 0)) / (2 * h), (at(0, h) - at(0, -h)) / (2 * h)], rel=1e-4
    )
    assert hxx == pytest.approx((at(h, 0) - 2 * energy + at(-h, 0)) / h**2, rel=1e-3)
    assert hyy == pytest.approx((at(0, h) - 2 * energy + at(0, -h)) / h**2, rel=1e-3)
    mixed = (at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4 * h**2)
    assert hxy == pytest.approx(mixed, rel=1e-3, abs=1e-3 * (hxx + hyy))


def test_newton_gradient_is_the_slope_of_the_energy():
    V, F = crumpled()
    level, reference = whole_level(V, F)
    S = icosphere(3)[0]
    frames, (gradient, _, _), _ = assembled(level, S, reference)
    direction = np.random.default_rng(1).standard_normal(gradient.shape)
    velocity = np.einsum("ni,nij->nj", direction, frames)
    ahead, behind = (
        (S + t * velocity) / np.linalg.norm(S + t * velocity, axis=1)[:, None]
        for t in (1e-6, -1e-6)
    )
    slope = (
        total_energy(level.tail, ahead, reference) - total_energy(level.tail, behind, reference)
    ) / 2e-6
    assert slope == pytest.approx(np.sum(gradient * direction), rel=1e-5)


def test_newton_hessian_is_positive_and_second_order_near_the_minimum():
    V, F = icosphere(2)
    level, reference = whole_level(V, F)
    frames, _, H = assembled(level, V, reference)
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
