"""Collapses to a tetrahedron and their limits; half-edges, quadrics, and undoing."""

import numpy as np
import pytest
from genus_zero import SHAPES, crumpled, icosphere

from ripple_sim.solver.layouts.sphere_map import (
    corner_table,
    decimate,
    undo_collapse,
    vertex_quadrics,
)


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
    return vertex_quadrics(
        np.ascontiguousarray(F, dtype=np.int32).ravel(), np.asarray(V, dtype=float)
    )


def quadratic_form(quadric: np.ndarray) -> np.ndarray:
    """The symmetric matrix [4, 4] of (x, y, z, 1), whose ten numbers a quadric has."""
    xx, xy, xz, yy, yz, zz, x, y, z, constant = quadric
    return np.array([[xx, xy, xz, x], [xy, yy, yz, y], [xz, yz, zz, z], [x, y, z, constant]])


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
        homogeneous = np.append(p, 1)
        error = homogeneous @ quadratic_form(quadrics[v]) @ homogeneous
        assert error == pytest.approx(total, rel=1e-10)  # round-off


@pytest.mark.parametrize("third", [[2.0, 0, 0], [0.0, 0, 0]], ids=["in line", "a point twice"])
def test_triangles_without_area_have_no_quadric(third):
    quadrics = quadrics_of([[0, 0, 0], [1, 0, 0], third], [[0, 1, 2]])
    np.testing.assert_array_equal(quadrics, np.zeros((3, 10)))
