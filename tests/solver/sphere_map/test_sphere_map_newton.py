"""The Newton step of the sphere map: its gradient, its Hessian, and the solver of its equations."""

import numpy as np
import pytest
import trimesh

from ripple_sim.solver.sphere_map.conjugate_gradients import solve
from ripple_sim.solver.sphere_map.corner_table import corner_table
from ripple_sim.solver.sphere_map.energy import Reference, total_energy
from ripple_sim.solver.sphere_map.hessian import assemble
from ripple_sim.solver.sphere_map.level import build_level, star_shapes
from ripple_sim.solver.sphere_map.newton import newton_step, tangents
from ripple_sim.solver.sphere_map.relaxation import sweep
from ripple_sim.solver.sphere_map.star import TERMS, energy_after, expand, slopes, tangent_move


def icosphere(subdivisions):
    mesh = trimesh.creation.icosphere(subdivisions)
    return np.array(mesh.vertices), np.array(mesh.faces)


def crumpled():
    V, F = icosphere(3)
    return V + 0.2 * np.random.default_rng(0).standard_normal(V.shape), F


def whole_level(V, F):
    """The finest level of a mesh and its reference triangles."""
    table = corner_table(F, len(V))
    level = build_level(table, np.arange(len(V)), np.arange(len(F)))
    area = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) / 2
    sides = np.stack([V[F[:, (j + 2) % 3]] - V[F[:, (j + 1) % 3]] for j in range(3)], axis=1)
    dots = np.stack([-np.sum(sides[:, (j + 1) % 3] * sides[:, (j + 2) % 3], axis=1) for j in range(3)], axis=1)
    cotangent = dots / (2 * area[:, None])
    return level, Reference(area, (cotangent / (2 * area[:, None])).ravel())


def assembled(level, S, reference):
    n = len(S)
    gradient, diagonal, blocks = np.empty((n, 2)), np.empty((n, 3)), np.empty((len(level.ends), 4))
    x, y = tangents(S)
    energy = assemble(level, S, reference, x, y, gradient, diagonal, blocks)
    assert energy == pytest.approx(total_energy(level.tail, S, reference), rel=1e-12)
    frames = np.stack([x, y], axis=1)
    H = np.zeros((n, 2, n, 2))
    for v, (xx, xy, yy) in enumerate(diagonal):
        H[v, :, v, :] = [[xx, xy], [xy, yy]]
    for (u, v), block in zip(level.ends, blocks.reshape(-1, 2, 2), strict=True):
        H[u, :, v, :] = block
        H[v, :, u, :] = block.T
    return frames, gradient, diagonal, blocks, H.reshape(2 * n, 2 * n)


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


def test_conjugate_gradients_solve_the_newton_system():
    V, F = crumpled()
    level, reference = whole_level(V, F)
    _, gradient, diagonal, blocks, H = assembled(level, icosphere(3)[0], reference)
    step = solve(level.ends, diagonal, blocks, gradient, 5000, 1e-10)
    np.testing.assert_allclose(H @ step.ravel(), -gradient.ravel(), atol=1e-6 * np.abs(gradient).max())


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
