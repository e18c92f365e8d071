"""Links are as long as the path over the facets: folded paper carries flat waves.

A regular tetrahedron is a folded torus, half of it: its eigenvalues are known, whatever its edges.
"""

import dataclasses

import numpy as np
import pytest
import trimesh
from genus_zero import TETRAHEDRON
from scipy.sparse import diags_array
from scipy.sparse.linalg import eigsh

from ripple_sim.solver import Atlas, Mesh, build_atlas, load_atlas
from ripple_sim.solver.texels import (
    LINK_ENDS,
    SurfaceRide,
    TexelCells,
    link_exists,
    quad,
    stiffness_matrix,
)

# of a quad's links: sw, se, nw, ne
ENDS = np.array([(0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2)])


def paper(rng: np.random.Generator) -> tuple[Mesh, np.ndarray]:
    """A sheet folded at random angles into mountains and valleys, and its flat places [n, 2]."""
    cuts = np.sort(rng.uniform(0, 1, 9))
    x = np.concatenate([[0], cuts, [1]])
    angle = np.cumsum(rng.uniform(-1.2, 1.2, len(x) - 1))
    step = np.diff(x)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    profile = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    y = np.linspace(0, 1, 8)
    flat = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    flat[1:-1, 1:-1, 1] += rng.uniform(-0.05, 0.05, (len(cuts), 6))  # along the folds
    bent = np.concatenate(
        [np.broadcast_to(profile[:, None], (*flat.shape[:2], 2)), flat[..., 1:]], axis=-1
    )
    node = np.arange(flat[..., 0].size).reshape(flat.shape[:2])
    a, b, c, d = (
        each.ravel() for each in (node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:])
    )
    F = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return Mesh.from_arrays(bent.reshape(-1, 3) @ turn, F), flat.reshape(-1, 2)


def lengths(atlas: Atlas, places: np.ndarray) -> np.ndarray:
    """Straight lengths of all links between places [C, n, n, d]; 0 where no link is."""
    around = atlas.texels.topology.with_halo(places)
    found = []
    for link, (a, b) in enumerate(LINK_ENDS):
        exists = link_exists(atlas.texels.topology, link)
        found.append(np.where(exists, np.linalg.norm(around[a] - around[b], axis=-1), 0))
    return np.array(found)


@pytest.mark.parametrize("resolution", [8, 20])
def test_ways_over_folded_paper_are_as_long_as_on_flat_paper(resolution: int) -> None:
    mesh, flat = paper(np.random.default_rng(0))
    atlas = build_atlas(mesh, resolution, cache=False, layout="patches")
    places = np.einsum("...k,...kj->...j", atlas.barycentrics, flat[mesh.F[atlas.triangles]])
    straight = lengths(atlas, atlas.positions)
    ways = lengths(atlas, places)
    detours = atlas.texels.detours[:, :, :-1, :-1]
    exists = ways > 0
    excess = (straight * np.sqrt(1 + detours))[exists] / ways[exists] - 1
    assert excess.min() > -3e-4  # no way is shorter than on flat paper
    assert np.quantile(excess, 0.999) < 3e-4
    # a way keeps to the edges that a plane cuts: it may pass a fold's corner on the longer side
    assert excess.max() < 2e-3
    np.testing.assert_array_equal(straight[~exists], 0.0)
    assert (straight < 0.9 * ways).any()


def test_a_bent_quad_weighs_as_much_as_the_flat_one() -> None:
    rng = np.random.default_rng(1)
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) + rng.uniform(-0.25, 0.25, (100, 4, 2))
    flat = np.concatenate([corners, np.zeros((100, 4, 1))], axis=2)
    bent = flat.copy()
    bent[..., 0] = np.sin(flat[..., 0])  # shorter, and out of the plane
    bent[..., 2] = 1 - np.cos(flat[..., 0])
    squares = [
        ((each[:, ENDS[:, 1]] - each[:, ENDS[:, 0]]) ** 2).sum(axis=-1).T for each in (flat, bent)
    ]
    straight = np.zeros((6, 100))
    detours = squares[0] / squares[1] - 1
    exact, chords, found = (
        np.array(quad(*(each[:, 1:] - each[:, :1]).transpose(1, 2, 0), way)[:6])
        for each, way in ((flat, straight), (bent, straight), (bent, detours))
    )
    np.testing.assert_allclose(found, exact, atol=1e-9)
    assert np.abs(chords - exact).max() > 0.05


def test_no_detours_make_a_quad_with_negative_energy() -> None:
    rng = np.random.default_rng(2)
    e, n, p = rng.standard_normal((3, 3, 3000))
    weights = np.array(quad(e, n, p, 4 * rng.uniform(size=(6, 3000)) ** 4)[:6])
    matrices = np.zeros((3000, 4, 4))
    for (i, j), weight in zip(ENDS, weights, strict=True):
        matrices[:, [i, j], [j, i]] -= weight[:, None]
        matrices[:, [i, j], [i, j]] += weight[:, None]
    values = np.linalg.eigvalsh(matrices)
    assert (values[:, 0] > -1e-10 * values[:, -1]).all()


def tetrahedron() -> Mesh:
    """Regular, with edges of length 1, each cut in half."""
    V, F = TETRAHEDRON
    return Mesh.from_arrays(*trimesh.remesh.subdivide(V / np.sqrt(8), F))


def tetrahedron_errors(atlas: Atlas) -> np.ndarray:
    """Relative errors of the eigenvalues 2 to 20: the even half of waves on a torus."""
    m, n = np.meshgrid(np.arange(-6, 7), np.arange(-6, 7))
    exact = 4 * np.pi**2 / 3 * np.sort((m**2 + m * n + n**2).ravel())[1::2][:19]
    stiffness = stiffness_matrix(atlas.texels.stencil(np.ones(atlas.areas.shape)))
    found = eigsh(
        stiffness.tocsc(),
        20,
        diags_array(atlas.areas.ravel()).tocsc(),
        sigma=-1,
        return_eigenvectors=False,
    )
    return np.abs(np.sort(found)[1:] / exact - 1)


@pytest.mark.parametrize("layout", ["cube", "patches"])
def test_eigenvalues_of_a_tetrahedron_converge_over_its_edges(layout: str) -> None:
    atlases = [build_atlas(tetrahedron(), n, cache=False, layout=layout) for n in (16, 32)]
    coarse, fine = (tetrahedron_errors(each).mean() for each in atlases)
    assert fine < 3e-3
    assert coarse / fine > 3.2  # 2 with straight links
    chords = dataclasses.replace(atlases[1].texels, detours=None)
    assert tetrahedron_errors(dataclasses.replace(atlases[1], texels=chords)).mean() > 2 * fine


@pytest.mark.parametrize("layout", ["cube", "patches"])
def test_the_stiffness_stays_symmetric_and_holds_no_constant(layout: str) -> None:
    atlas = build_atlas(tetrahedron(), 8, cache=False, layout=layout)
    matrix = stiffness_matrix(atlas.texels.stencil(np.ones(atlas.areas.shape))).toarray()
    assert atlas.texels.detours.any()
    assert (matrix == matrix.T).all()
    np.testing.assert_allclose(matrix.sum(axis=1), 0, atol=1e-12)
    values = np.linalg.eigvalsh(matrix)
    assert values[0] > -1e-12 * values[-1] and values[1] > 1e-3 * values[-1] / atlas.areas.size


def test_charts_agree_on_shared_lengths_to_the_last_bit() -> None:
    atlas = build_atlas(tetrahedron(), 6, cache=False, layout="patches")
    topology = atlas.texels.topology
    known = {}
    there = np.where(topology.rim, -1, topology.halo)
    for link, (a, b) in enumerate(LINK_ENDS):
        first = there[a]
        second = there[b]
        detours = atlas.texels.detours[link][:, :-1, :-1]
        for i, j, detour in zip(first.ravel(), second.ravel(), detours.ravel(), strict=True):
            if min(i, j) >= 0:
                assert known.setdefault((min(i, j), max(i, j)), detour) == detour


def test_a_moved_surface_keeps_its_detours_as_shares(tmp_path) -> None:
    atlas = build_atlas(tetrahedron(), 8, cache=False)
    atlas.save(tmp_path / "kept.atlas")
    kept = load_atlas(tmp_path / "kept.atlas")
    np.testing.assert_array_equal(kept.texels.detours, atlas.texels.detours)
    ones = np.ones(atlas.areas.shape)
    turn = np.linalg.qr(np.random.default_rng(3).standard_normal((3, 3)))[0]
    around = SurfaceRide(kept).around(2 * kept.mesh.V @ turn + 1)
    cells: TexelCells = kept.texels.cells
    moved = cells.moved(around, cells.coefficient(ones, ones, 0.0))[0].weights
    still = atlas.texels.stencil(ones).weights
    np.testing.assert_allclose(moved, still, atol=3e-6 * np.abs(still).max())
