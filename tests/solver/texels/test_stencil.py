"""The stencil, with its links across sides and beyond the nine points, and as a sparse matrix."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square

from ripple_sim.solver.texels import TexelMesh, crossing_links, stiffness_matrix


def test_both_copies_of_a_link_across_a_side_are_the_same_to_the_last_bit(bumpy: TexelMesh) -> None:
    n = bumpy.resolution
    stencil = bumpy.stencil(np.random.default_rng(1).uniform(0.1, 2, (6, n, n)))
    crossing = crossing_links(bumpy.topology)
    assert (np.diff(crossing.begins) == 2).all()
    first, second = stencil.weights.ravel()[crossing.copies].reshape(-1, 2).T
    np.testing.assert_array_equal(first, second)
    # nine-point stencil everywhere but at the 24 texels round the cube's corners, which have one
    # diagonal less
    assert np.bincount(np.diff(stiffness_matrix(stencil).indptr))[8:].tolist() == [
        24,
        6 * n * n - 24,
    ]


def test_stiffness_is_positive_but_for_the_constant(bumpy: TexelMesh) -> None:
    n = bumpy.resolution
    rng = np.random.default_rng(7)
    # far from smooth: texels that lie anywhere
    texels = bumpy.with_positions(bumpy.positions + 0.2 * rng.standard_normal((6, n, n, 3)))
    values = np.linalg.eigvalsh(stiffness_matrix(texels.stencil(np.ones((6, n, n)))).toarray())
    assert abs(values[0]) < 1e-10
    assert values[1] > 1e-3


MESHES = {
    "square": lambda: square(5),
    "torus": lambda: flat_torus(5),
    "three charts round a point": lambda: polygon(3, 4),
    "six charts round a point": lambda: polygon(6, 4),
    "seven charts round a point": lambda: polygon(7, 4),
}


@pytest.fixture(params=MESHES)
def texels(request: pytest.FixtureRequest) -> TexelMesh:
    return MESHES[request.param]()


def test_the_product_is_minus_the_stencils_value(texels: TexelMesh) -> None:
    rng = np.random.default_rng(0)
    stencil = texels.stencil(rng.uniform(0.2, 3, texels.shape))
    matrix = stiffness_matrix(stencil)
    for field in rng.standard_normal((3, *texels.shape)):
        np.testing.assert_allclose(matrix @ field.ravel(), -stencil(field).ravel(), atol=1e-12)


def test_the_matrix_is_symmetric_and_constants_are_its_kernel(texels: TexelMesh) -> None:
    stencil = texels.stencil(np.ones(texels.shape))
    dense = stiffness_matrix(stencil).toarray()
    assert dense.shape == (texels.topology.texel_count,) * 2
    np.testing.assert_allclose(dense, dense.T, atol=1e-14)
    np.testing.assert_allclose(dense.sum(axis=1), 0, atol=1e-12)
    values = np.linalg.eigvalsh(dense)
    assert values[0] > -1e-12 and values[1] > 1e-3
    off = dense - np.diag(dense.diagonal())
    np.testing.assert_allclose(np.abs(off).sum(axis=1), stencil.absolute_sums().ravel(), atol=1e-12)


def test_links_to_a_fixed_rim_count_half_in_gershgorins_bound() -> None:
    stencil = square(6).with_fixed_rim().stencil(np.ones((1, 6, 6)))
    rows = np.abs(stiffness_matrix(stencil).toarray()).sum(axis=1)
    np.testing.assert_allclose(2 * stencil.absolute_sums().ravel(), rows, atol=1e-12)
