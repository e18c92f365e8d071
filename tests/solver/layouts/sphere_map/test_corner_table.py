"""Half-edges: stars, collapses against triangle lists, and their undoing."""

import numpy as np
import pytest
from genus_zero import TETRAHEDRON, bipyramid, icosphere

from ripple_sim.solver.layouts.sphere_map.decimation import (
    collapse,
    corner_table,
    following,
    gather_star,
    is_collapsible,
    mark_neighbours,
    preceding,
    undo_collapse,
)

SHAPES = {
    "tetrahedron": lambda: TETRAHEDRON,
    "bipyramid of three": lambda: bipyramid(3),
    "octahedron": lambda: bipyramid(4),
    "fan of 40": lambda: bipyramid(40),
    "sphere": lambda: icosphere(1),
}


@pytest.fixture(params=SHAPES)
def mesh(request):
    return SHAPES[request.param]()


def table_of(mesh):
    V, F = mesh
    return corner_table(F, len(V))


def star_of(table, v):
    star = np.empty(len(table.leaving), np.int32)
    return star[: gather_star(table, v, star)]


def neighbours(table, v):
    return [int(table.tail[following(h)]) for h in star_of(table, v)]


def collapsible(table, h):
    mark = np.full(len(table.leaving), -1, np.int32)
    u, v = table.tail[h], table.tail[table.twin[h]]
    mark_neighbours(table, u, mark)
    return is_collapsible(table, u, v, mark)


def turned(triangles):
    """Triangles as a set, each from its least vertex on."""
    return {tuple(np.roll(t, -int(np.argmin(t))).tolist()) for t in triangles}


def alive(table, log):
    """Triangles that collapses have left."""
    gone = {int(g) // 3 for h in log for g in (h, table.twin[h])}
    return [f for f in range(len(table.tail) // 3) if f not in gone]


def test_twins_are_one_side_seen_from_both_triangles(mesh):
    table = table_of(mesh)
    h = np.arange(len(table.tail))
    head = table.tail[[following(each) for each in h]]
    np.testing.assert_array_equal(table.twin[table.twin], h)
    assert (table.twin // 3 != h // 3).all()
    np.testing.assert_array_equal(table.tail[table.twin], head)
    np.testing.assert_array_equal(table.tail[table.leaving], np.arange(len(table.leaving)))


@pytest.mark.parametrize("h", range(6))
def test_three_steps_round_a_triangle_lead_back(h):
    round_trip = [h, following(h), following(following(h))]
    assert sorted(round_trip) == [3 * (h // 3) + j for j in range(3)]
    assert preceding(following(h)) == h == following(round_trip[2])


def test_a_star_holds_all_triangles_of_its_vertex_counterclockwise(mesh):
    V, F = mesh
    table = table_of(mesh)
    for v in range(len(V)):
        ring = neighbours(table, v)
        fan = [(v, a, b) for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]
        assert turned(fan) == turned(F[(v == F).any(axis=1)])


def test_link_condition_counts_common_neighbours(mesh):
    V, F = mesh
    adjacent = [set(F[(v == F).any(axis=1)].ravel().tolist()) - {v} for v in range(len(V))]
    table = table_of(mesh)
    for h in range(len(table.tail)):
        common = adjacent[table.tail[h]] & adjacent[table.tail[table.twin[h]]]
        assert collapsible(table, h) == (len(common) == 2)


def test_an_edge_of_the_waist_of_a_bipyramid_of_three_cannot_collapse():
    table = table_of(bipyramid(3))
    waist = [h for h in range(18) if max(table.tail[h], table.tail[table.twin[h]]) < 3]
    assert len(waist) == 6 and not any(collapsible(table, h) for h in waist)


def test_a_collapse_merges_the_tail_into_the_head_in_every_triangle():
    V, F = icosphere(1)
    for h in (0, 7, 100):
        table = corner_table(F, len(V))
        u, v = int(table.tail[h]), int(table.tail[table.twin[h]])
        expected = [t for t in np.where(u == F, v, F) if len(set(t)) == 3]
        collapse(table, h)
        left = alive(table, [h])
        assert turned(table.tail.reshape(-1, 3)[left]) == turned(expected)
        assert len(left) == len(F) - 2
        for w in set(range(len(V))) - {u}:
            assert table.leaving[w] // 3 in left and table.tail[table.leaving[w]] == w
            fan = {int(g) // 3 for g in star_of(table, w)}
            assert fan == {f for f in left if w in table.tail[3 * f : 3 * f + 3]}


@pytest.mark.parametrize("seed", range(3))
def test_undone_collapses_leave_the_table_as_it_was(seed):
    rng, (V, F) = np.random.default_rng(seed), icosphere(1)
    table, log, before = corner_table(F, len(V)), [], []
    while len(log) < len(V) - 5:
        h = int(rng.choice([3 * f + j for f in alive(table, log) for j in range(3)]))
        if collapsible(table, h):
            before.append([table.tail.copy(), table.twin.copy()])
            log.append(h)
            collapse(table, h)
    for h, (tail, twin) in zip(log[::-1], before[::-1], strict=True):
        undo_collapse(table, h)
        np.testing.assert_array_equal(table.tail, tail)
        np.testing.assert_array_equal(table.twin, twin)
        assert table.tail[table.leaving[tail[h]]] == tail[h]
    np.testing.assert_array_equal(table.tail[table.leaving], np.arange(len(V)))
