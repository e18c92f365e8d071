"""The finite-element stencil: symmetry, conservation, and the cells it is made of."""

import numpy as np
import pytest
from scipy.sparse import coo_array

from ripple_sim.solver import sphere_atlas
from ripple_sim.solver.cube_map.convention import cube_topology, texel_directions
from ripple_sim.solver.texels.cells import quad
from ripple_sim.solver.texels.links import link_lengths
from ripple_sim.solver.texels.stiffness_matrix import stiffness_matrix
from ripple_sim.solver.texels.texel_mesh import TexelMesh


def element(corners: np.ndarray) -> tuple[np.ndarray, float]:
    """Stiffness matrix and area of a cell with 3 or 4 corners [k, 3], in order round it."""
    if len(corners) == 4:
        frame = np.array([corners[2] - corners[0], corners[3] - corners[1]])
        differences = np.array([[-1.0, 0, 1, 0], [0, -1, 0, 1]])
        area = np.linalg.norm(np.cross(*frame)) / 2
    else:
        frame = corners[1:] - corners[0]
        differences = np.array([[-1.0, 1, 0], [-1, 0, 1]])
        area = np.linalg.norm(np.cross(*frame)) / 2
    # the gradient in space whose components along the frame are the differences
    gradient = np.linalg.pinv(frame) @ differences
    stiffness = area * gradient.T @ gradient
    if len(corners) == 4:
        hourglass = np.array([1.0, -1, 1, -1])
        stiffness += hourglass_stiffness(frame, area) * np.outer(hourglass, hourglass)
        triangles = corners[[[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]]]
        edges = triangles[:, 1:] - triangles[:, :1]
        twice = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
        area = min(twice[:2].sum(), twice[2:].sum()) / 2
    return stiffness, area


def hourglass_stiffness(diagonals: np.ndarray, area: float) -> float:
    """What waves in time ask for, but no more than a share of what the time step allows, or a square's."""
    first, second = (diagonals[0] - diagonals[1]) / 2, (diagonals[0] + diagonals[1]) / 2
    long, both = max(first @ first, second @ second), first @ first + second @ second
    in_time = both * area / 2 / (area**2 + 3 * (first @ second) ** 2)
    free = (long**2 - (first @ second) ** 2) / (4 * long * area)
    return min(in_time, max(0.75 * free, 0.4 * 2 * area / both))


def brute_force_laplacian(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness matrix and lumped areas, cell by cell."""
    n = positions.shape[1]
    x = positions.reshape(-1, 3)
    index = cube_topology(n).halo
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
        part, area = element(x[ring])
        stiffness[np.ix_(ring, ring)] -= part
        areas[ring] += area / len(ring)
    return stiffness, areas


@pytest.fixture(scope="module")
def bumpy() -> TexelMesh:
    """Star-shaped body without any symmetry."""
    d = texel_directions(6)
    rng = np.random.default_rng(3)
    return TexelMesh.of(cube_topology(6), d * (1 + 0.3 * np.sin(d @ rng.uniform(1, 3, 3))[..., None]) * [1.0, 0.7, 1.3])


def test_stencil_equals_brute_force_assembly(bumpy: TexelMesh) -> None:
    stiffness, areas = brute_force_laplacian(bumpy.positions)
    h = np.random.default_rng(0).standard_normal((6, 6, 6))
    stencil = bumpy.stencil(np.ones((6, 6, 6)))
    np.testing.assert_allclose(stencil(h).ravel(), stiffness @ h.ravel(), atol=1e-12)
    np.testing.assert_allclose(bumpy.stiffness().toarray(), -stiffness, atol=1e-12)
    np.testing.assert_allclose(bumpy.areas.ravel(), areas, rtol=1e-12)


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


def test_sphere_area_converges_at_second_order() -> None:
    error = [4 * np.pi - TexelMesh.of(cube_topology(n), texel_directions(n)).areas.sum() for n in (8, 16, 32, 64)]
    orders = np.log2(np.array(error[:-1]) / error[1:])
    assert (orders > 1.95).all()


def test_link_lengths_are_distances_between_neighbours() -> None:
    atlas = sphere_atlas(2.0, 12)
    lengths = link_lengths(atlas.texels.topology, atlas.texels.halo_positions)[:, :2]
    ideal = 2.0 * np.pi / 2 / 12
    finite = lengths[np.isfinite(lengths) & (lengths > 0)] / ideal
    # equiangular cells are as wide as ideal ones on a face's middle lines and narrowest beside the cube's edges
    assert 0.7 < finite.min() < 0.8
    assert 0.99 < finite.max() <= 1.0


@pytest.mark.parametrize(("long", "angle"), [(1.0, 30.0), (2.0, 35.0), (3.0, 20.0), (1.3, 150.0)])
def test_waves_over_sheared_quads_are_in_time_in_the_mean_over_their_directions(long: float, angle: float) -> None:
    east = np.array([long, 0.0, 0.0])
    north = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
    sides_ew, sides_ns, rising, falling, area = quad(0 * east, east, north, east + north)
    direction = np.linspace(0, np.pi, 180, endpoint=False)
    errors = []
    for k in (0.2, 0.1):
        wave = k * np.stack([np.cos(direction), np.sin(direction), 0 * direction], axis=1)
        theta, phi = wave @ east, wave @ north
        # every side belongs to two quads
        squared = (
            2 * sides_ew * (2 - 2 * np.cos(theta))
            + 2 * sides_ns * (2 - 2 * np.cos(phi))
            + rising * (2 - 2 * np.cos(theta + phi))
            + falling * (2 - 2 * np.cos(theta - phi))
        ) / area
        errors.append(abs(np.mean(squared / k**2) - 1))
    # the error in k^2 is gone, that in k^4 is left
    assert errors[1] < errors[0] / 14


def test_softened_cells_are_as_stiff_as_their_softest_corner(bumpy: TexelMesh) -> None:
    n = bumpy.resolution
    even = np.ones((6, n, n))
    factors = even.copy()
    factors[0, 2, 3] = 0.25
    stiff, soft = bumpy.stencil(even), bumpy.stencil(even, factors)
    h = np.zeros((6, n, n))
    h[0, 2, 3] = 1.0
    np.testing.assert_allclose(soft(h)[0, 2, 3], 0.25 * stiff(h)[0, 2, 3])
    h = np.random.default_rng(2).standard_normal((6, n, n))
    changed = soft(h) != stiff(h)
    assert changed[0, 1:4, 2:5].all()
    assert changed.sum() == 9
