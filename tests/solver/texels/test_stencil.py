"""The finite-element stencil: symmetry, conservation, and the cells it is made of."""

import numpy as np
from scipy.sparse import coo_array

from ripple_sim.solver.layouts.cube.convention import cube_topology
from ripple_sim.solver.texels.stencil import stiffness_matrix
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
