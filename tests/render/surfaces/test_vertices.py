"""The vertices that a target is drawn with: on its surface, split where they must be, and looked up in one place."""

import numpy as np
import pytest
from drawn import ball_surface

from ripple_sim.render.surfaces.vertices import (
    BAKED,
    COORDINATES,
    DIRECTION,
    NORMAL,
    POSITION,
    UV,
    mapped_coordinates,
    surface_vertices,
)
from ripple_sim.render.visuals.texture_mapping import Mapping


@pytest.fixture(scope="module")
def vertices():
    return surface_vertices(ball_surface("clay", 0.5), 0.2, 100)


def test_vertices_and_midpoints_lie_on_the_ball_and_point_outwards(vertices):
    position = vertices.attributes[:, POSITION]
    # an edge of the mesh bulges out to a cubic close to the arc
    np.testing.assert_allclose(np.linalg.norm(position, axis=1), 0.5, atol=2e-3)
    outwards = position / np.linalg.norm(position, axis=1, keepdims=True)
    for columns in (DIRECTION, NORMAL):
        np.testing.assert_allclose(np.linalg.norm(vertices.attributes[:, columns], axis=1), 1.0, atol=1e-9)
        np.testing.assert_allclose(vertices.attributes[:, columns], outwards, atol=0.02)
    np.testing.assert_allclose(vertices.attributes[:, BAKED][:, 0], 1.0, atol=1e-5)


def test_heights_at_one_point_are_looked_up_in_one_place(vertices):
    """Also at midpoints of edges along a border."""
    points = np.concatenate([vertices.attributes[:, POSITION], vertices.attributes[:, DIRECTION]], axis=1)
    _, point = np.unique(points, axis=0, return_inverse=True)
    pairs = np.unique(np.column_stack([point.ravel(), vertices.lookups]), axis=0)
    assert len(pairs) == len(np.unique(point)) < len(points)
    # points are one where they are nearly one
    assert len(np.unique(points.round(9), axis=0)) == len(np.unique(point))


def test_midpoints_come_last_and_lie_halfway_on_the_map(vertices):
    count = len(vertices.edges.ends)
    coordinates = vertices.attributes[:, COORDINATES]
    np.testing.assert_allclose(coordinates[-count:], coordinates[vertices.edges.ends].mean(axis=1), atol=1e-12)
    assert vertices.F.max() < len(coordinates) - count


def test_a_surface_counts_v_from_below_and_a_model_from_above(vertices):
    attributes = vertices.attributes[:4].copy()
    attributes[:, UV] = [[0, 0], [1, 0], [0.25, 1], [0.5, 0.75]]
    own = mapped_coordinates(attributes, Mapping(own=True))
    np.testing.assert_allclose(own, [[0, 1, 0], [1, 1, 0], [0.25, 0, 0], [0.5, 0.25, 0]])
    by_place = mapped_coordinates(attributes, Mapping(scale=np.array([1.0, 2.0, 4.0])))
    np.testing.assert_allclose(by_place, attributes[:, POSITION] * [1, 2, 4])
