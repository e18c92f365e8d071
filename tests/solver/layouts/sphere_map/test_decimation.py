"""Collapses down to a tetrahedron, and what they keep for as long as possible; half-edges, quadrics, and undoing."""

import numpy as np
import pytest
from genus_zero import SHAPES, TETRAHEDRON, bipyramid, crumpled, icosphere

from ripple_sim.solver.layouts.sphere_map.decimation import (
    collapse,
    corner_table,
    decimate,
    following,
    gather_star,
    is_collapsible,
    preceding,
    undo_collapse,
    vertex_quadrics,
)

SMALL = {
    "tetrahedron": lambda: TETRAHEDRON,
    "bipyramid of three": lambda: bipyramid(3),
    "octahedron": lambda: bipyramid(4),
    "fan of 40": lambda: bipyramid(40),
    "sphere": lambda: icosphere(1),
}


@pytest.fixture(params=SMALL)
def mesh(request):
    return SMALL[request.param]()


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
    mark[neighbours(table, u)] = u
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
    head = table.tail[following(h)]
    np.testing.assert_array_equal(preceding(following(h)), h)
    np.testing.assert_array_equal(table.twin[table.twin], h)
    assert (table.twin // 3 != h // 3).all()
    np.testing.assert_array_equal(table.tail[table.twin], head)
    np.testing.assert_array_equal(table.tail[table.leaving], np.arange(len(table.leaving)))


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


def decimated(V, F):
    table = corner_table(F, len(V))
    return table, decimate(table, V)


def last_vertices(table, log):
    return set(range(len(table.leaving))) - set(table.tail[log].tolist())


@pytest.mark.parametrize("shape", sorted(set(SHAPES) - {"six limbs"}))
def test_every_shape_collapses_to_a_tetrahedron_and_back(shape):
    V, F = SHAPES[shape]()
    table, log = decimated(V, F)
    assert len(log) == len(V) - 4
    assert len(set(table.tail[log])) == len(log)
    gone = np.concatenate([log // 3, table.twin[log] // 3])
    assert len(set(gone)) == len(F) - 4
    left = table.tail.reshape(-1, 3)[np.setdiff1d(np.arange(len(F)), gone)]
    last = last_vertices(table, log)
    assert len({frozenset(t) for t in left.tolist()}) == 4
    assert all(set(t) < last and len(set(t)) == 3 for t in left.tolist())
    for h in log[::-1]:
        undo_collapse(table, h)
    np.testing.assert_array_equal(table.tail.reshape(-1, 3), F)
    np.testing.assert_array_equal(table.twin, corner_table(F, len(V)).twin)


def test_a_tetrahedron_has_nothing_to_collapse():
    V, F = TETRAHEDRON
    assert len(decimated(V, F)[1]) == 0


def test_the_tip_of_a_needle_is_kept_to_the_end():
    V, F = icosphere(2)
    V[17] *= 20
    assert 17 in last_vertices(*decimated(V, F))


def test_size_of_the_mesh_does_not_change_the_order_of_its_collapses():
    V, F = crumpled()
    np.testing.assert_array_equal(decimated(4.0 * V, F)[1], decimated(V, F)[1])


@pytest.mark.parametrize("place", [0.0, 1.0])
def test_a_mesh_that_is_one_point_still_collapses(place):
    V, F = icosphere(1)
    assert len(decimated(np.full_like(V, place), F)[1]) == len(V) - 4


def quadrics_of(V, F):
    return vertex_quadrics(np.ascontiguousarray(F, dtype=np.int32).ravel(), np.asarray(V, dtype=float))


def quadric_error(q, p):
    """Sum of squared distances of p from the planes of a quadric [10], as a form of (x, y, z, 1)."""
    matrix = np.array([[q[0], q[1], q[2], q[6]], [q[1], q[3], q[4], q[7]], [q[2], q[4], q[5], q[8]], [*q[6:9], q[9]]])
    return np.append(p, 1) @ matrix @ np.append(p, 1)


def test_quadric_error_is_the_sum_of_squared_distances_weighted_by_area():
    V, F = crumpled()
    quadrics = quadrics_of(V, F)
    p = np.array([0.3, -2.0, 1.1])
    for v in (0, 17, 400):
        total = 0.0
        for triangle in F[(v == F).any(axis=1)]:
            a, b, c = V[triangle]
            normal = np.cross(b - a, c - a)
            twice_area = np.linalg.norm(normal)
            total += twice_area / 2 * (normal / twice_area @ (p - a)) ** 2
        assert quadric_error(quadrics[v], p) == pytest.approx(total, rel=1e-10)


def test_a_vertex_lies_in_all_its_planes():
    V, F = crumpled()
    errors = [quadric_error(q, p) for q, p in zip(quadrics_of(V, F), V, strict=True)]
    np.testing.assert_allclose(errors, 0, atol=1e-13)


@pytest.mark.parametrize("third", [[2.0, 0, 0], [0.0, 0, 0]], ids=["in line", "a point twice"])
def test_triangles_without_area_have_no_quadric(third):
    quadrics = quadrics_of([[0, 0, 0], [1, 0, 0], third], [[0, 1, 2]])
    np.testing.assert_array_equal(quadrics, np.zeros((3, 10)))
