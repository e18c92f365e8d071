"""The root of the Laplacian: against a dense one, its symmetry, its mean, and its inverse."""

import numpy as np
import pytest
from scipy.linalg import eigh

from ripple_sim.solver import Atlas, sphere_atlas
from ripple_sim.solver.operator.deep_water import HalfLaplacian
from ripple_sim.solver.texels.stencil import stiffness_matrix


@pytest.fixture(scope="module")
def atlas() -> Atlas:
    return sphere_atlas(0.3, 10)


@pytest.fixture(scope="module")
def root(atlas: Atlas) -> HalfLaplacian:
    return HalfLaplacian(atlas.texels.stencil(np.ones_like(atlas.areas)), atlas.areas)


def test_it_is_the_dense_root_within_a_thousandth(atlas: Atlas, root: HalfLaplacian) -> None:
    matrix = stiffness_matrix(atlas.texels.stencil(np.ones_like(atlas.areas))).toarray()
    squares, modes = eigh(matrix, np.diag(atlas.areas.ravel()))
    for k in (1, 5, 40, 300, len(squares) - 1):
        mode = modes[:, k].reshape(atlas.areas.shape)
        error = root(mode) - np.sqrt(squares[k]) * mode
        assert np.abs(error).max() < 1e-3 * np.sqrt(squares[k]) * np.abs(mode).max()
    assert root.most == pytest.approx(np.sqrt(squares[-1]), rel=0.01)


def test_it_is_symmetric_and_gives_nothing_of_a_constant(atlas: Atlas, root: HalfLaplacian) -> None:
    a, b = np.random.default_rng(0).normal(size=(2, *atlas.areas.shape))
    forth, back = (atlas.areas * a * root(b)).sum(), (atlas.areas * b * root(a)).sum()
    assert forth == pytest.approx(back, rel=1e-10)
    assert (atlas.areas * a * root(a)).sum() > 0
    assert np.abs(root(np.ones_like(a))).max() < 1e-9 * root.most
    assert abs((atlas.areas * root(a)).sum()) < 1e-9


def test_its_inverse_is_one(atlas: Atlas, root: HalfLaplacian) -> None:
    field = np.random.default_rng(1).normal(size=atlas.areas.shape)
    field -= (atlas.areas * field).sum() / atlas.areas.sum()
    np.testing.assert_allclose(root(root.inverse(field)), field, atol=1e-7)
    np.testing.assert_allclose(root.inverse(root(field)), field, atol=1e-7)


def test_waves_of_a_sphere_are_of_its_harmonics(atlas: Atlas, root: HalfLaplacian) -> None:
    x, _, z = np.moveaxis(atlas.positions / 0.3, -1, 0)
    for degree, harmonic in ((1, z), (2, x * z), (3, z * (5 * z * z - 3))):
        share = (root(harmonic) * harmonic).sum() / (harmonic**2).sum()
        assert share == pytest.approx(np.sqrt(degree * (degree + 1)) / 0.3, rel=0.02)
