"""Levels of detail renumber what is left of a mesh."""

import numpy as np
import pytest
from genus_zero import TETRAHEDRON, bipyramid, icosphere
from levels import whole_level

from ripple_sim.solver.layouts.sphere_map.decimation import collapse, corner_table, decimate
from ripple_sim.solver.layouts.sphere_map.level import build_level, star_shapes


def partial_level(V, F, count):
    """The level with `count` vertices, their numbers in the mesh, and the triangles by these numbers."""
    table = corner_table(F, len(V))
    whole = corner_table(F, len(V))
    log = decimate(whole, V)[: len(V) - count]
    for h in log:
        collapse(table, h)
    vertices = np.setdiff1d(np.arange(len(V)), table.tail[log])
    triangles = np.setdiff1d(np.arange(len(F)), np.concatenate([log // 3, table.twin[log] // 3]))
    level = build_level(table, vertices, triangles)
    return level, vertices, table.tail.reshape(-1, 3)[triangles]


@pytest.mark.parametrize("count", [4, 5, 20, 42])
def test_a_level_has_the_triangles_that_collapses_left(count):
    level, vertices, triangles = partial_level(*icosphere(1), count)
    assert len(vertices) == count and len(triangles) == 2 * count - 4
    np.testing.assert_array_equal(vertices[level.tail.reshape(-1, 3)], triangles)
    head = np.roll(level.tail.reshape(-1, 3), -1, axis=1).ravel()
    np.testing.assert_array_equal(head[level.star], level.ring)
    np.testing.assert_array_equal(level.tail[level.star], np.repeat(np.arange(count), np.diff(level.star_start)))


@pytest.mark.parametrize("count", [4, 5, 20, 42])
def test_every_edge_of_a_level_has_two_half_edges_and_the_ends_of_the_lower_one(count):
    level, *_ = partial_level(*icosphere(1), count)
    head = np.roll(level.tail.reshape(-1, 3), -1, axis=1).ravel()
    assert len(level.ends) == 3 * count - 6
    for e, (a, b) in enumerate(level.ends):
        lower, upper = np.flatnonzero(level.edge == e)
        assert (level.tail[lower], head[lower]) == (a, b)
        assert (level.tail[upper], head[upper]) == (b, a)


@pytest.mark.parametrize("shape", [TETRAHEDRON, bipyramid(3), bipyramid(60), icosphere(1)])
def test_rings_go_counterclockwise_and_stars_lead_to_them(shape):
    V, F = shape
    level, _ = whole_level(V, F)
    head = np.roll(level.tail.reshape(-1, 3), -1, axis=1).ravel()
    np.testing.assert_array_equal(head[level.star], level.ring)
    np.testing.assert_array_equal(level.tail[level.star], np.repeat(np.arange(len(V)), np.diff(level.star_start)))
    for v in range(len(V)):
        first, last = level.star_start[v : v + 2]
        for a, b, h in zip(
            level.ring[first:last], np.roll(level.ring[first:last], -1), level.star[first:last], strict=True
        ):
            assert {v, int(a), int(b)} == set(F[h // 3].tolist())
            assert np.linalg.det(V[[v, a, b]]) > 0  # seen from outside


def test_shapes_of_a_star_name_the_angles_at_the_vertex_and_at_its_neighbours():
    V, F = icosphere(1)
    V = V * [1.0, 2.0, 0.5]
    level, reference = whole_level(V, F)
    shapes = star_shapes(level.star, reference)
    first, last = level.star_start[3:5]
    for i in range(first, last):
        neighbour = level.ring[i]
        (apex,) = set(F[level.star[i] // 3].tolist()) - {3, int(neighbour)}
        for at, (p, q, r) in enumerate([(3, neighbour, apex), (neighbour, apex, 3), (apex, 3, neighbour)], start=1):
            e, f = V[q] - V[p], V[r] - V[p]
            twice_area = np.linalg.norm(np.cross(e, f))
            assert shapes[i, 0] == pytest.approx(twice_area / 2)
            assert shapes[i, at] == pytest.approx(e @ f / twice_area / twice_area)
