"""The stencil, with its links across sides and beyond the nine points, and as a sparse matrix."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square

from ripple_sim.solver import sphere_atlas
from ripple_sim.solver.texels.stencil import (
    NO_LINKS,
    IrregularLinks,
    crossing_links,
    gather_links,
    link_lengths,
    stiffness_matrix,
)
from ripple_sim.solver.texels.texel_mesh import TexelMesh


def test_both_copies_of_a_link_across_a_side_are_the_same_to_the_last_bit(bumpy: TexelMesh) -> None:
    n = bumpy.resolution
    stencil = bumpy.stencil(np.random.default_rng(1).uniform(0.1, 2, (6, n, n)))
    crossing = crossing_links(bumpy.topology)
    assert (np.diff(crossing.begins) == 2).all()
    first, second = stencil.weights.ravel()[crossing.copies].reshape(-1, 2).T
    np.testing.assert_array_equal(first, second)
    # nine-point stencil everywhere but at the 24 texels round the cube's corners, which have one diagonal less
    assert np.bincount(np.diff(stiffness_matrix(stencil).indptr))[8:].tolist() == [24, 6 * n * n - 24]


def test_stiffness_is_positive_but_for_the_constant(bumpy: TexelMesh) -> None:
    n = bumpy.resolution
    rng = np.random.default_rng(7)
    # far from smooth: texels that lie anywhere
    texels = bumpy.with_positions(bumpy.positions + 0.2 * rng.standard_normal((6, n, n, 3)))
    values = np.linalg.eigvalsh(stiffness_matrix(texels.stencil(np.ones((6, n, n)))).toarray())
    assert abs(values[0]) < 1e-10
    assert values[1] > 1e-3


def random_links(size: int, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    first, second = np.triu_indices(size, 1)
    chosen = rng.choice(len(first), count, replace=False)
    ends = np.stack([first[chosen], second[chosen]], axis=1)
    flipped = rng.random(count) < 0.5
    ends[flipped] = ends[flipped, ::-1]
    return ends, rng.standard_normal(count)


def laplacian(size: int, ends: np.ndarray, weights: np.ndarray) -> np.ndarray:
    matrix = np.zeros((size, size))
    for (i, j), weight in zip(ends, weights, strict=True):
        matrix[[i, j], [j, i]] += weight
        matrix[[i, j], [i, j]] -= weight
    return matrix


@pytest.mark.parametrize(("size", "count"), [(2, 1), (5, 10), (30, 40)])
def test_gathering_adds_the_product_with_the_links_matrix(size: int, count: int) -> None:
    ends, weights = random_links(size, count, seed=size)
    links = IrregularLinks.of(ends, weights)
    assert links is not None
    rng = np.random.default_rng(1)
    field, out = rng.standard_normal(size), rng.standard_normal(size)
    expected = out + laplacian(size, ends, weights) @ field
    before = out.sum()
    gather_links(links, field, out)
    np.testing.assert_allclose(out, expected, atol=1e-12)
    # what one end gains the other loses, and constants feel nothing
    assert out.sum() == pytest.approx(before)
    gather_links(links, np.full(size, 3.0), before_constant := out.copy())
    assert (before_constant == out).all()


def test_texels_come_once_in_order_each_with_all_its_links() -> None:
    links = IrregularLinks.of(np.array([[7, 2], [2, 5], [9, 7]]), np.array([1.0, 2.0, 3.0]))
    assert links is not None
    assert links.texels.tolist() == [2, 5, 7, 9]
    assert links.begins.tolist() == [0, 2, 3, 5, 6]
    assert links.others.tolist() == [5, 7, 2, 2, 9, 7]
    assert links.weights.tolist() == [2, 1, 2, 1, 3, 3]


def test_where_there_are_no_links_nothing_is_stored_and_nothing_added() -> None:
    assert IrregularLinks.of(np.zeros((0, 2), np.int64), np.zeros(0)) is None
    out = np.arange(4.0)
    gather_links(NO_LINKS, np.ones(4), out)
    assert out.tolist() == [0, 1, 2, 3]


def test_link_lengths_are_distances_between_neighbours() -> None:
    atlas = sphere_atlas(2.0, 12)
    lengths = link_lengths(atlas.texels.topology, atlas.texels.halo_positions)[:, :2]
    ideal = 2.0 * np.pi / 2 / 12
    finite = lengths[np.isfinite(lengths) & (lengths > 0)] / ideal
    # equiangular cells are as wide as ideal ones on a face's middle lines and narrowest beside the cube's edges
    assert 0.7 < finite.min() < 0.8
    assert 0.99 < finite.max() <= 1.0


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


@pytest.mark.parametrize("k", [1, 2, 4])
def test_waves_along_the_grid_of_a_torus_have_the_eigenvalue_of_a_string_of_texels(k: int) -> None:
    n = 8
    column = np.indices((n, n))[1]
    wave = np.cos(2 * np.pi * k * column / n).ravel()
    np.testing.assert_allclose(flat_torus(n).stiffness() @ wave, (2 - 2 * np.cos(2 * np.pi * k / n)) * wave, atol=1e-12)


def test_a_coefficient_of_0_cuts_a_texel_off() -> None:
    texels = flat_torus(6)
    coefficient = np.ones(texels.shape)
    coefficient[0, 2, 3] = 0
    matrix = stiffness_matrix(texels.stencil(coefficient)).toarray()
    assert not matrix[15].any() and not matrix[:, 15].any()
    # the others still hang together
    assert np.linalg.matrix_rank(matrix, tol=1e-9) == 34
