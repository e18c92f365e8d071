"""Every rival against dense matrices in double precision, written down texel by texel."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ripple_sim.bench.rivals import NaiveLoop, PlainShader, SparseLeapfrog
from ripple_sim.solver import GLError, Material, sphere_atlas
from ripple_sim.solver.operator.assembly import build_operator
from ripple_sim.solver.operator.wave_operator import WaveOperator

N = 4
RIVALS: dict[str, Callable[[WaveOperator], Any]] = {
    "naive loop": NaiveLoop,
    "naive loop, prange": lambda operator: NaiveLoop(operator, parallel=True),
    "sparse matrix": SparseLeapfrog,
    "plain shader": PlainShader,
}
# from a texel with halo to its neighbour: east, north, north-east, north-west
NEIGHBOURS = ((0, 1), (1, 0), (1, 1), (1, -1))


@pytest.fixture(scope="module")
def operator() -> WaveOperator:
    x, z = (sphere_atlas(1.0, N).positions[..., k] for k in (0, 2))
    return build_operator(sphere_atlas(1.0, N), Material(speed=1.5 + z / 2, density=2.0 - x), "fem")


@pytest.fixture(scope="module")
def acceleration(operator: WaveOperator) -> np.ndarray:
    """Accelerations per height, [6 N N, 6 N N], from the links between texels."""
    texel = operator.topology.halo.reshape(6, N + 2, N + 2)
    matrix = np.zeros((6 * N * N, 6 * N * N))
    for f, r, c in np.ndindex(6, N, N):
        for k, (down, right) in enumerate(NEIGHBOURS):
            for sign in (1, -1):
                here, there = (r + 1, c + 1), (r + 1 + sign * down, c + 1 + sign * right)
                row, column = min(here[0], there[0]), min(here[1], there[1])
                weight = operator.stencil.weights[f, k, row, column]
                i, j = texel[f, *here], texel[f, *there]
                if weight:
                    matrix[i, j] += weight
                    matrix[i, i] -= weight
    return matrix / operator.mass.ravel()[:, None]


def made(name: str, operator: WaveOperator) -> Any:
    try:
        return RIVALS[name](operator)
    except GLError as error:
        pytest.skip(str(error))


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((6, N, N)).astype(np.float32)


def test_the_reference_conserves_momentum(acceleration: np.ndarray, operator: WaveOperator) -> None:
    """Links pull both ends alike, and a lift of the whole surface pulls nothing."""
    np.testing.assert_allclose(operator.mass.ravel() @ acceleration, 0, atol=1e-5)
    np.testing.assert_allclose(acceleration.sum(axis=1), 0, atol=1e-9)


@pytest.mark.parametrize("name", RIVALS)
@pytest.mark.parametrize("substeps", [1, 2, 7])
def test_rival_takes_the_steps_of_dense_matrices(
    name: str, substeps: int, operator: WaveOperator, acceleration: np.ndarray
) -> None:
    rival, start, dt = made(name, operator), noise(1), 0.6 * operator.stable_timestep
    h, v = start.ravel().astype(float), np.zeros(start.size)
    for _ in range(substeps):
        v += dt * acceleration @ h
        h += dt * v
    rival.set_height(start)
    rival.advance(substeps, dt)
    height, velocity = rival.state()
    assert height.shape == velocity.shape == (6, N, N)
    np.testing.assert_allclose(height.ravel(), h, atol=3e-6 * np.abs(h).max())
    np.testing.assert_allclose(velocity.ravel(), v, atol=3e-6 * np.abs(v).max())


@pytest.mark.parametrize("name", RIVALS)
def test_a_state_is_a_copy_and_few_or_no_steps_can_be_taken(name: str, operator: WaveOperator) -> None:
    rival, dt = made(name, operator), 0.6 * operator.stable_timestep
    rival.set_height(noise(2))
    before = rival.state()
    rival.advance(0, dt)
    for now, then in zip(rival.state(), before, strict=True):
        np.testing.assert_array_equal(now, then)
    rival.advance(5, dt)
    np.testing.assert_array_equal(before[0], noise(2))
    at_once = made(name, operator)
    at_once.set_height(noise(2))
    at_once.advance(2, dt)
    at_once.advance(3, dt)
    for now, then in zip(at_once.state(), rival.state(), strict=True):
        np.testing.assert_array_equal(now, then)


@pytest.mark.parametrize("name", RIVALS)
def test_momentum_stays_zero_and_a_lifted_surface_at_rest(name: str, operator: WaveOperator) -> None:
    rival, dt = made(name, operator), 0.6 * operator.stable_timestep
    rival.set_height(noise(3))
    rival.advance(20, dt)
    velocity = rival.state()[1].astype(float)
    assert abs((operator.mass * velocity).sum()) < 1e-5 * (operator.mass * np.abs(velocity)).sum()
    lifted = made(name, operator)
    lifted.set_height(np.full((6, N, N), 0.5, np.float32))
    lifted.advance(20, dt)
    np.testing.assert_allclose(lifted.state()[0], 0.5, rtol=1e-5)
