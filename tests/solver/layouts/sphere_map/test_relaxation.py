"""Sweeps lower the energy.

The star of a vertex knows the energy of every place of it.
"""

import numpy as np
import pytest
from levels import crumpled, icosphere, whole_level

from ripple_sim.solver.layouts.sphere_map.energy import total_energy
from ripple_sim.solver.layouts.sphere_map.hessian import tangents
from ripple_sim.solver.layouts.sphere_map.level import star_shapes
from ripple_sim.solver.layouts.sphere_map.relaxation import TERMS, energy_after, expand, slopes, sweep, tangent_move


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


def star_terms(level, S, reference, v):
    """What `expand` says of one vertex's star."""
    first, last = level.star_start[v], level.star_start[v + 1]
    x, y = tangents(S)
    terms = np.empty((last - first, TERMS))
    ring, shapes = S[level.ring[first:last]], star_shapes(level.star, reference)[first:last]
    expand(tuple(S[v]), tuple(x[v]), tuple(y[v]), ring, shapes, last - first, terms)
    return terms, x[v], y[v]


@pytest.mark.parametrize("v", [0, 5, 100])
def test_the_expanded_star_knows_the_energy_of_every_place(v):
    V, F = crumpled()
    level, reference = whole_level(V, F)
    S = icosphere(3)[0]
    terms, x, y = star_terms(level, S, reference, v)
    at_rest = total_energy(level.tail, S, reference)
    for a, b in np.random.default_rng(v).uniform(-0.05, 0.05, (10, 2)):
        move = tangent_move(a, b)
        moved = S.copy()
        moved[v] += move[0] * x + move[1] * y + move[2] * S[v]
        assert np.linalg.norm(moved[v]) == pytest.approx(1, abs=1e-15)
        rise = energy_after(move, terms, len(terms)) - energy_after((0.0, 0.0, 0.0), terms, len(terms))
        expected = total_energy(level.tail, moved, reference) - at_rest
        assert rise == pytest.approx(expected, rel=1e-6, abs=1e-11 * at_rest)


def test_the_expanded_star_sees_folds():
    V, F = icosphere(2)
    level, reference = whole_level(V, F)
    terms, *_ = star_terms(level, V, reference, 20)
    assert energy_after(tangent_move(0.05, 0.0), terms, len(terms)) < np.inf
    assert energy_after(tangent_move(0.9, 0.0), terms, len(terms)) == np.inf


def test_slopes_of_the_expanded_star_are_those_of_its_energy():
    V, F = crumpled()
    level, reference = whole_level(V, F)
    terms, *_ = star_terms(level, icosphere(3)[0], reference, 7)
    degree, h = len(terms), 1e-4

    def at(a, b):
        return energy_after(tangent_move(a, b), terms, degree)

    energy, gx, gy, hxx, hxy, hyy = slopes(terms, degree)
    assert energy == pytest.approx(at(0.0, 0.0), rel=1e-14)
    assert [gx, gy] == pytest.approx([(at(h, 0) - at(-h, 0)) / (2 * h), (at(0, h) - at(0, -h)) / (2 * h)], rel=1e-4)
    assert hxx == pytest.approx((at(h, 0) - 2 * energy + at(-h, 0)) / h**2, rel=1e-3)
    assert hyy == pytest.approx((at(0, h) - 2 * energy + at(0, -h)) / h**2, rel=1e-3)
    mixed = (at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h)) / (4 * h**2)
    assert hxy == pytest.approx(mixed, rel=1e-3, abs=1e-3 * (hxx + hyy))
