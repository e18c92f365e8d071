"""Cells added up chart by chart, against the same cells added up one by one in Python."""

import numpy as np
import pytest
from hand_made import RIM, flat_charts, flat_torus, polygon, square

from ripple_sim.solver import TexelMesh
from ripple_sim.solver.layouts.cube.convention import cube_topology
from ripple_sim.solver.texels.cells import quad, triangle


def add_links(matrix: np.ndarray, ends: list[tuple[int, int]], weights: list[float]) -> None:
    for (i, j), weight in zip(ends, weights, strict=True):
        matrix[[i, j], [j, i]] -= weight
        matrix[[i, j], [i, j]] += weight


def cell_by_cell(texels: TexelMesh, k: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness matrix and areas of a mesh without rims: each cell once, by the texels at its corners."""
    topology, around = texels.topology, texels.halo_positions
    k, s, count = k.ravel(), s.ravel(), topology.texel_count
    matrix, areas, seen = np.zeros((count, count)), np.zeros(count), set()
    charts, n, _ = topology.shape
    for chart, r, c in np.ndindex(charts, n + 1, n + 1):
        places = [(r, c), (r, c + 1), (r + 1, c), (r + 1, c + 1)]
        there = [(int(topology.halo[chart, *place]), around[chart, *place]) for place in places]
        there = [(index, point) for index, point in there if index >= 0]
        indices, points = [i for i, _ in there], [x for _, x in there]
        if frozenset(indices) in seen:
            continue
        seen.add(frozenset(indices))
        conductance = len(indices) / (1 / k[indices]).sum() * s[indices].min()
        if len(indices) == 4:
            *weights, area = quad(*(np.array(points[1:]) - points[0]))
            ends = [(0, 1), (2, 3), (0, 2), (1, 3), (0, 3), (1, 2)]
        else:
            *weights, area = triangle(*points)
            ends = [(1, 2), (2, 0), (0, 1)]
        add_links(matrix, [(indices[i], indices[j]) for i, j in ends], [conductance * w for w in weights])
        for index in indices:
            areas[index] += area / len(indices)
    return matrix, areas


def uneven_torus() -> TexelMesh:
    """Rows and columns of uneven width, on a slope: no two cells are alike."""
    texels = flat_torus(5)
    bend = texels.beyond + 0.03 * np.sin(2 * np.pi * texels.beyond @ np.array([[1, 0, 2], [1, 1, 0], [0, 0, 0]]))
    return TexelMesh.of(texels.topology, bend[:, 1:-1, 1:-1], beyond=bend)


def test_coefficients_and_softening_of_every_cell_count_once(bumpy: TexelMesh) -> None:
    rng = np.random.default_rng(0)
    for texels in (bumpy, uneven_torus()):
        k, s = rng.uniform(0.2, 4, texels.shape), rng.uniform(0.1, 1, texels.shape)
        matrix, areas = cell_by_cell(texels, k, s)
        field = rng.standard_normal(texels.shape)
        np.testing.assert_allclose(-texels.stencil(k, s)(field).ravel(), matrix @ field.ravel(), atol=1e-11)
        np.testing.assert_allclose(texels.areas.ravel(), areas, rtol=1e-12)


@pytest.mark.parametrize("k", [1, 2, 5])
def test_strips_at_free_edges_make_the_modes_of_a_string_with_free_ends(k: int) -> None:
    n = 6
    texels = square(n)
    mode = np.broadcast_to(np.cos(np.pi * k * (np.arange(n) + 0.5) / n), (1, n, n))
    stencil = texels.stencil(np.ones(texels.shape))
    for wave in (mode, mode.transpose(0, 2, 1)):
        np.testing.assert_allclose(-stencil(wave), (2 - 2 * np.cos(np.pi * k / n)) * wave, atol=1e-12)
    np.testing.assert_allclose(texels.areas, 1 / n**2)


def test_charts_turned_against_each_other_and_a_rim_make_the_same_surface() -> None:
    left = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    right = left + np.array([1, 0, 0])
    n = 4
    field = np.random.default_rng(1).standard_normal((n, 2 * n))
    expected = None
    for turn in range(4):
        # the right chart begins at another corner; the side that faces the left one is its side 3 - turn
        side = (3 - turn) % 4
        glued = [[RIM, (1, side), RIM, RIM], [(0, 1) if i == side else RIM for i in range(4)]]
        texels = flat_charts([left, np.roll(right, -turn, axis=0)], glued, n)
        column, row = np.rint(texels.positions[..., :2] * n - 0.5).astype(int).transpose(3, 0, 1, 2)
        force = texels.stencil(np.ones(texels.shape))(field[row, column])
        found = np.empty_like(field)
        found[row, column] = force
        expected = found if expected is None else expected
        np.testing.assert_allclose(found, expected, atol=1e-12)
        np.testing.assert_allclose(texels.areas, 1 / n**2)


def test_media_in_series_carry_the_same_flux() -> None:
    n = 6
    columns = np.array([1.0, 5.0, 0.2, 3.0, 3.0, 0.5])
    texels = square(n)
    # what a layered medium holds in balance: its slope times the mean of the layers' resistances is the flux
    steps = (1 / columns[:-1] + 1 / columns[1:]) / 2
    height = np.broadcast_to(np.concatenate([[0], np.cumsum(steps)]), (1, n, n))
    force = texels.stencil(np.broadcast_to(columns, (1, n, n)).copy())(height)
    np.testing.assert_allclose(force[0, :, 1:-1], 0, atol=1e-12)
    np.testing.assert_allclose(force[0, :, 0], 1)
    np.testing.assert_allclose(force[0, :, -1], -1)


def test_a_triangle_with_a_corner_of_coefficient_0_is_cut_off() -> None:
    texels = polygon(3, 4)
    coefficient = np.ones(texels.shape)
    coefficient[0, 0, 0] = 0
    force = texels.stencil(coefficient)(np.random.default_rng(2).standard_normal(texels.shape))
    assert force[0, 0, 0] == 0
    assert np.isfinite(force).all() and force.sum() == pytest.approx(0, abs=1e-12)


def test_where_a_rim_has_no_positions_the_surface_ends_at_the_last_texels() -> None:
    n = 5
    texels = square(n)
    ends = TexelMesh.of(texels.topology, texels.positions)
    share = np.full((n, n), 4.0)
    share[[0, -1]] /= 2
    share[:, [0, -1]] /= 2
    np.testing.assert_allclose(ends.areas[0], share / 4 / n**2)


def test_texels_in_one_point_have_neither_area_nor_weight() -> None:
    topology = cube_topology(4)
    texels = TexelMesh.of(topology, np.ones((*topology.shape, 3)))
    assert not texels.areas.any()
    assert not texels.stencil(np.ones(topology.shape)).weights.any()
