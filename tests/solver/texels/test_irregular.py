"""Links beyond the stencil: stored for both ends, gathered as a matrix would."""

import numpy as np
import pytest

from ripple_sim.solver.texels.stencil import NO_LINKS, IrregularLinks, gather_links


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
