"""Single loops of the CPU backend against numpy, on charts with rims and irregular corners."""

import numpy as np
import pytest
from dense_waves import matrix
from hand_made import flat_torus, polygon, square

from ripple_sim.solver import TexelMesh
from ripple_sim.solver.backends.cpu import FieldLayout
from ripple_sim.solver.backends.kernels import drift, fill, flow, kick_texels
from ripple_sim.solver.backends.stencil_loops import Drift, Loads, Plasticity, apply

MESHES = [square(1), square(6), polygon(3, 5), polygon(5, 4), flat_torus(7)]


@pytest.fixture(params=MESHES, ids=lambda each: str(each.shape))
def texels(request: pytest.FixtureRequest) -> TexelMesh:
    return request.param


def noise(texels: TexelMesh, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(texels.shape).astype(np.float32)


def laid_out(layout: FieldLayout, values: np.ndarray) -> np.ndarray:
    field = layout.zeros()
    layout.texels(field)[:] = values
    return field


@pytest.mark.parametrize("add", [False, True])
@pytest.mark.parametrize("uniform", [False, True])
def test_the_stencil_on_a_field_is_its_matrix(texels: TexelMesh, add: bool, uniform: bool) -> None:
    layout, stencil = FieldLayout(texels.topology), texels.stencil(1 + noise(texels, 0) ** 2)
    field, before = noise(texels, 1), noise(texels, 2)
    factor = np.float32(-1) if uniform else noise(texels, 3)
    h, out = laid_out(layout, field), laid_out(layout, before)
    fill(h, layout.halo)
    apply(layout.weights(stencil), h, layout.coefficients(factor), add, out)
    sums = (matrix(stencil, field.size) @ field.ravel().astype(float)).reshape(texels.shape)
    expected = factor * sums + (before if add else 0)
    np.testing.assert_allclose(layout.texels(out), expected, atol=1e-5 * max(1, np.abs(expected).max()))


def test_a_constant_height_makes_no_force(texels: TexelMesh) -> None:
    layout = FieldLayout(texels.topology)
    h, out = laid_out(layout, np.full(texels.shape, 3.0)), laid_out(layout, noise(texels, 1))
    fill(h, layout.halo)
    apply(layout.weights(texels.stencil(np.ones(texels.shape))), h, np.float32(1), False, out)
    assert not layout.texels(out).any()


@pytest.mark.parametrize("everywhere", [False, True])
def test_a_drift_shifts_movable_texels_and_moves_all(texels: TexelMesh, everywhere: bool) -> None:
    layout, h, v = FieldLayout(texels.topology), noise(texels, 1), noise(texels, 2)
    movable = np.float32(1) if everywhere else (noise(texels, 3) > 0).astype(np.float32)
    height, velocity = laid_out(layout, h), laid_out(layout, v)
    drift(height, velocity, Drift(layout.columns, layout.coefficients(movable), np.float32(0.5), np.float32(0.1)))
    shifted = v + np.float32(0.5) * movable
    np.testing.assert_allclose(layout.texels(velocity), shifted, rtol=1e-6)
    np.testing.assert_allclose(layout.texels(height), h + np.float32(0.1) * shifted, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("limit", [0.0, 0.7, np.inf, "map"])
def test_a_flow_keeps_the_whole_height_and_at_most_the_yield_height_elastic(texels: TexelMesh, limit) -> None:
    layout, h, dent = FieldLayout(texels.topology), noise(texels, 1), noise(texels, 2)
    most = np.abs(noise(texels, 3)) if limit == "map" else np.float32(limit)
    elastic = laid_out(layout, h)
    plasticity = Plasticity(layout.columns, layout.coefficients(most), laid_out(layout, dent))
    for _ in range(2):  # once more changes nothing
        flow(elastic, plasticity)
        np.testing.assert_array_equal(layout.texels(elastic), np.clip(h, -most, most))
        total = layout.texels(elastic) + layout.texels(plasticity.dent)
        np.testing.assert_allclose(total, h + dent, atol=1e-6)


@pytest.mark.parametrize("count", [0, 1, 5])
def test_kicked_texels_drift_by_their_kick_and_others_not_at_all(count: int) -> None:
    texels = polygon(3, 5)
    layout, h, v = FieldLayout(texels.topology), noise(texels, 1), noise(texels, 2)
    chosen = np.random.default_rng(4).permutation(h.size)[:count]
    kicks = np.linspace(1, 2, count).astype(np.float32)
    height, velocity = laid_out(layout, h), laid_out(layout, v)
    kick_texels(height, velocity, Loads(layout.addresses[chosen], kicks), np.float32(0.25))
    expected = np.zeros(h.size, np.float32)
    expected[chosen] = kicks
    np.testing.assert_allclose(layout.texels(velocity).ravel(), v.ravel() + expected, rtol=1e-6)
    np.testing.assert_allclose(layout.texels(height).ravel(), h.ravel() + 0.25 * expected, rtol=1e-5, atol=1e-6)
