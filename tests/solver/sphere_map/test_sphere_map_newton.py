"""The Newton step of the sphere map: its gradient, its Hessian, and the solver of its equations."""

import numpy as np
import pytest
import trimesh

from ripple_sim.solver.sphere_map import newton
from ripple_sim.solver.sphere_map.conjugate_gradients import solve
from ripple_sim.solver.sphere_map.corner_table import corner_table
from ripple_sim.solver.sphere_map.energy import Reference, total_energy
from ripple_sim.solver.sphere_map.level import build_level


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
    frames, gradient, diagonal = np.empty((n, 2, 3)), np.empty((n, 2)), np.empty((n, 3))
    blocks = np.empty((len(level.ends), 4))
    newton._assemble(level.tail, level.edge, level.ends, S, reference, frames, gradient, diagonal, blocks)
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
        newton.newton_step(level, S, reference)
    assert total_energy(level.tail, S, reference) < (1 + 1e-4) * least
