"""The finite-element stencil: symmetry, conservation, and the cells it is made of.

Links beyond the stencil: stored for both ends, gathered as a matrix would.

The links' lengths.
"""

import numpy as np
import pytest
from scipy.sparse import coo_array

from ripple_sim.solver import sphere_atlas
from ripple_sim.solver.layouts.cube.convention import cube_topology
from ripple_sim.solver.texels.stencil import NO_LINKS, IrregularLinks, gather_links, link_lengths, stiffness_matrix
from ripple_sim.solver.texels.texel_mesh import TexelMesh


def test_operator_is_symmetric_to_the_last_bit(bumpy: TexelMesh) -> None:
    n = bumpy.resolution
    rng = np.random.default_rng(1)
    stencil = bumpy.stencil(rng.uniform(0.1, 2, (6, n, n))).weights.astype(np.float32)
    index = cube_topology(n).halo
    rows, columns, values = [], [], []
    for link, (a, b) in enumerate(
        [
            (index[:, :-1, :-1], index[:, :-1, 1:]),
            (index[:, :-1, :-1], index[:, 1:, :-1]),
            (index[:, :-1, :-1], index[:, 1:, 1:]),
            (index[:, :-1, 1:], index[:, 1:, :-1]),
        ]
    ):
        exists = (a >= 0) & (b >= 0) & (stencil[:, link] != 0)
        rows.append(a[exists])
        columns.append(b[exists])
        values.append(stencil[:, link][exists])
    i, j, w = np.concatenate(rows), np.concatenate(columns), np.concatenate(values)
    pairs: dict[tuple[int, int], set[float]] = {}
    for p, q, value in zip(i.tolist(), j.tolist(), w.tolist(), strict=True):
        pairs.setdefault((min(p, q), max(p, q)), set()).add(value)
    assert all(len(copies) == 1 for copies in pairs.values())
    graph = coo_array((np.ones(len(i)), (i, j)), shape=(6 * n * n, 6 * n * n)).toarray()
    valence = ((graph + graph.T) > 0).sum(axis=1)
    # nine-point stencil everywhere but at the 24 texels round the cube's corners, which have one diagonal less
    assert sorted(np.unique(valence, return_counts=True)[1].tolist()) == [24, 6 * n * n - 24]
    assert valence.max() == 8


def test_stiffness_is_positive_but_for_the_constant(bumpy: TexelMesh) -> None:
    n = bumpy.resolution
    rng = np.random.default_rng(7)
    # far from smooth: texels that lie anywhere
    texels = bumpy.with_positions(bumpy.positions + 0.2 * rng.standard_normal((6, n, n, 3)))
    values = np.linalg.eigvalsh(stiffness_matrix(texels.stencil(np.ones((6, n, n)))).toarray())
    assert abs(values[0]) < 1e-10
    assert values[1] > 1e-3


def test_constant_field_feels_no_force(bumpy: TexelMesh) -> None:
    force = bumpy.stencil(np.full((6, 6, 6), 2.0))(np.full((6, 6, 6), 5.0))
    assert np.abs(force).max() == 0


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
    # what one end gains the other loses
    assert out.sum() == pytest.approx(before)


def test_texels_come_once_in_order_each_with_all_its_links() -> None:
    links = IrregularLinks.of(np.array([[7, 2], [2, 5], [9, 7]]), np.array([1.0, 2.0, 3.0]))
    assert links is not None
    assert links.texels.tolist() == [2, 5, 7, 9]
    assert links.begins.tolist() == [0, 2, 3, 5, 6]
    assert links.others.tolist() == [5, 7, 2, 2, 9, 7]
    assert links.weights.tolist() == [2, 1, 2, 1, 3, 3]


def test_texels_without_links_and_constants_feel_nothing() -> None:
    links = IrregularLinks.of(np.array([[0, 3]]), np.array([4.0]))
    out = np.zeros(5)
    gather_links(links, np.full(5, 3.0), out)
    assert not out.any()
    gather_links(links, np.arange(5.0), out)
    assert out.tolist() == [12, 0, 0, -12, 0]


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
