"""The finite-element stencil: symmetry, conservation, and the triangles it is made of."""

import numpy as np
import pytest
from scipy.sparse import coo_array

from ripple_sim.solver import sphere_atlas
from ripple_sim.solver.cubemap import padded_indices, texel_directions
from ripple_sim.solver.operator import stencil_sum
from ripple_sim.solver.stencil import cotangent_stencil, link_lengths, lumped_areas, pad


def brute_force_laplacian(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness matrix and lumped areas, triangle by triangle, from every cell's two triangulations."""

    def quality(triangle: list[int]) -> float:
        p, q, s = x[triangle]
        return np.linalg.norm(np.cross(q - p, s - p)) / sum(e @ e for e in (q - p, s - q, p - s))

    n = positions.shape[1]
    x = positions.reshape(-1, 3)
    index = padded_indices(n)
    cells = {}
    for face in range(6):
        for r in range(n + 1):
            for c in range(n + 1):
                ring = [index[face, r, c], index[face, r, c + 1], index[face, r + 1, c + 1], index[face, r + 1, c]]
                ring = [i for i in ring if i >= 0]
                cells[frozenset(ring)] = ring
    stiffness = np.zeros((len(x), len(x)))
    areas = np.zeros(len(x))
    for ring in cells.values():
        if len(ring) == 3:
            triangles = [(ring, 1.0)]
        else:
            pairs = [[[ring[i] for i in t] for t in pair] for pair in (((0, 1, 2), (0, 2, 3)), ((0, 1, 3), (1, 2, 3)))]
            worth = [min(quality(t) for t in pair) ** 6 for pair in pairs]
            triangles = [(t, w / sum(worth)) for pair, w in zip(pairs, worth, strict=True) for t in pair]
        for triangle, share in triangles:
            for k in range(3):
                i, j, o = triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]
                a, b = x[i] - x[o], x[j] - x[o]
                double_area = np.linalg.norm(np.cross(a, b))
                weight = share * (a @ b) / double_area / 2
                stiffness[[i, j], [j, i]] += weight
                stiffness[[i, j], [i, j]] -= weight
                areas[o] += share * double_area / 6
    return stiffness, areas


@pytest.fixture(scope="module")
def bumpy() -> np.ndarray:
    """Texel positions of a star-shaped body without any symmetry."""
    d = texel_directions(6)
    rng = np.random.default_rng(3)
    return d * (1 + 0.3 * np.sin(d @ rng.uniform(1, 3, 3))[..., None]) * [1.0, 0.7, 1.3]


def test_stencil_equals_brute_force_assembly(bumpy: np.ndarray) -> None:
    stiffness, areas = brute_force_laplacian(bumpy)
    h = np.random.default_rng(0).standard_normal((6, 6, 6))
    stencil = cotangent_stencil(bumpy, np.ones((6, 6, 6)))
    np.testing.assert_allclose(stencil_sum(stencil, pad(h)).ravel(), stiffness @ h.ravel(), atol=1e-12)
    np.testing.assert_allclose(lumped_areas(bumpy).ravel(), areas, rtol=1e-12)


def test_operator_is_symmetric_to_the_last_bit(bumpy: np.ndarray) -> None:
    n = bumpy.shape[1]
    rng = np.random.default_rng(1)
    stencil = cotangent_stencil(bumpy, rng.uniform(0.1, 2, (6, n, n))).astype(np.float32)
    index = padded_indices(n)
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


def test_constant_field_feels_no_force(bumpy: np.ndarray) -> None:
    stencil = cotangent_stencil(bumpy, np.full((6, 6, 6), 2.0))
    force = stencil_sum(stencil, pad(np.full((6, 6, 6), 5.0)))
    assert np.abs(force).max() == 0


def test_sphere_area_converges_at_second_order() -> None:
    error = [4 * np.pi - lumped_areas(texel_directions(n)).sum() for n in (8, 16, 32, 64)]
    orders = np.log2(np.array(error[:-1]) / error[1:])
    assert (orders > 1.95).all()


def test_link_lengths_are_distances_between_neighbours() -> None:
    atlas = sphere_atlas(2.0, 12)
    lengths = link_lengths(atlas.positions)[:, :2]
    ideal = 2.0 * np.pi / 2 / 12
    finite = lengths[np.isfinite(lengths) & (lengths > 0)] / ideal
    # equiangular cells are as wide as ideal ones on a face's middle lines and narrowest beside the cube's edges
    assert 0.7 < finite.min() < 0.8
    assert 0.99 < finite.max() <= 1.0
