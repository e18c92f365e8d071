"""Quadrics against distances from planes."""

import numpy as np
import pytest
from genus_zero import bipyramid, crumpled

from ripple_sim.solver.layouts.sphere_map.decimation import quadric_error, vertex_quadrics


def quadrics_of(V, F):
    return vertex_quadrics(np.ascontiguousarray(F, dtype=np.int32).ravel(), np.asarray(V, dtype=float))


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
        assert quadric_error(quadrics[v], *p) == pytest.approx(total, rel=1e-10)


def test_a_vertex_lies_in_all_its_planes():
    V, F = crumpled()
    errors = [quadric_error(q, *p) for q, p in zip(quadrics_of(V, F), V, strict=True)]
    np.testing.assert_allclose(errors, 0, atol=1e-13)


def test_sum_of_two_quadrics_has_the_errors_of_both():
    V, F = bipyramid(5)
    quadrics, p = quadrics_of(V, F), (0.1, 0.2, 0.3)
    both = quadric_error(quadrics[0] + quadrics[3], *p)
    assert both == pytest.approx(quadric_error(quadrics[0], *p) + quadric_error(quadrics[3], *p))
    assert both > 0


@pytest.mark.parametrize("third", [[2.0, 0, 0], [0.0, 0, 0]], ids=["in line", "a point twice"])
def test_triangles_without_area_have_no_quadric(third):
    quadrics = quadrics_of([[0, 0, 0], [1, 0, 0], third], [[0, 1, 2]])
    np.testing.assert_array_equal(quadrics, np.zeros((3, 10)))
