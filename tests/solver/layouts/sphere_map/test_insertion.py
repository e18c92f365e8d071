"""Vertices come back one by one, and the map stays a bijection."""

import numpy as np
import pytest
from genus_zero import bipyramid, crumpled, icosphere, spiky, stretched

from ripple_sim.solver.layouts.energy import Reference
from ripple_sim.solver.layouts.sphere_map import certify
from ripple_sim.solver.layouts.sphere_map.decimation import corner_table, decimate, following, preceding
from ripple_sim.solver.layouts.sphere_map.level import RealSurface, carry, update_level
from ripple_sim.solver.layouts.sphere_map.progressive import SPHERE, TETRAHEDRON, insert_vertices, total_energy

SHAPES = {
    "sphere": lambda: icosphere(2),
    "fan of 100": lambda: bipyramid(100),  # its tips have more neighbours than are relaxed
    "cigar": lambda: stretched([1, 1, 10], subdivisions=2),
    "spikes": lambda: spiky(5),
    "crumpled": crumpled,
}


def collapsed(V, F):
    """A mesh with all collapses done and its last four vertices on the sphere: log, table, source, map, references."""
    area = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) / 2
    V, area = V * np.sqrt(4 * np.pi / area.sum()), area * 4 * np.pi / area.sum()
    carried = np.bincount(F.ravel(), np.repeat(area / 3, 3), len(V))
    table = corner_table(F, len(V))
    log = decimate(table, V)
    carry(table.tail[log], table.tail[table.twin[log]], carried)
    source = RealSurface(V, carried, np.ones(len(V)), 0.5, 0.5, 4 * np.pi / len(F))
    reference = Reference(np.zeros(len(F)), np.zeros(3 * len(F)), SPHERE)
    gone = np.concatenate([log // 3, table.twin[log] // 3])
    h = 3 * int(np.setdiff1d(np.arange(len(F)), gone)[0])
    last = np.setdiff1d(np.arange(len(V)), table.tail[log])
    corners = [int(table.tail[each]) for each in (h, following(h), preceding(h))]
    S = np.zeros_like(V)
    S[[*corners, *(set(last.tolist()) - set(corners))]] = TETRAHEDRON
    update_level(last, np.setdiff1d(np.arange(len(F)), gone), table, source, reference)
    return log, table, source, S, reference


@pytest.mark.parametrize("shape", SHAPES)
def test_all_vertices_come_back_without_a_fold(shape):
    V, F = SHAPES[shape]()
    log, table, source, S, reference = collapsed(V, F)
    insert_vertices(log, table, source, S, reference)
    np.testing.assert_array_equal(table.tail.reshape(-1, 3), F)
    np.testing.assert_allclose(np.linalg.norm(S, axis=1), 1, atol=1e-12)
    assert certify(F, S).valid
    assert np.isfinite(total_energy(table.tail, S, reference))


def test_area_goes_back_to_the_vertices_it_came_from():
    V, F = crumpled()
    log, table, source, S, reference = collapsed(V, F)
    insert_vertices(log, table, source, S, reference)
    V = source.V
    area = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) / 2
    np.testing.assert_allclose(source.carried, np.bincount(F.ravel(), np.repeat(area / 3, 3), len(V)), atol=1e-12)


def test_vertices_in_two_parts_find_the_same_places_as_in_one():
    V, F = icosphere(2)
    maps = []
    for cuts in ([0], [0, 60, 100]):
        log, table, source, S, reference = collapsed(V, F)
        for first, last in reversed(list(zip(cuts, [*cuts[1:], len(log)], strict=True))):
            insert_vertices(log[first:last], table, source, S, reference)
        maps.append(S)
    np.testing.assert_array_equal(*maps)


def test_without_collapses_nothing_moves():
    log, table, source, S, reference = collapsed(*icosphere(1))
    before = [table.tail.copy(), S.copy(), source.carried.copy()]
    insert_vertices(log[:0], table, source, S, reference)
    for now, then in zip((table.tail, S, source.carried), before, strict=True):
        np.testing.assert_array_equal(now, then)
