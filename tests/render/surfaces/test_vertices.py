"""The vertices that a target is drawn with: on its surface, split where they must be, and looked up in one place."""

import mujoco
import numpy as np
import pytest
from drawn import ball_surface

from ripple_sim.coupling.target_mesh import target_atlas
from ripple_sim.render.surfaces.surface import Charts, Surface
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


def test_a_wave_over_the_edges_of_a_box_is_a_smooth_curve():
    """Of 8 texels a length, at the worst moment: the chords of its curve are off by less than a fiftieth."""
    model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom type="box" size=".5 .4 .3"/></worldbody></mujoco>')
    atlas = target_atlas(model, 0, 32)
    surface = Surface(atlas.mesh.V, atlas.mesh.F, Charts.of(atlas), "clay")
    made = surface_vertices(surface, 0.02, 40_000)
    attributes, ends = made.attributes, made.edges.ends[~made.edges.inner]
    along = attributes[ends][..., POSITION]
    creases = np.flatnonzero((np.abs(along) > np.array([0.5, 0.4, 0.3]) - 1e-9).all(axis=1).sum(axis=1) == 2)
    texel = np.sqrt(atlas.areas.mean())
    # the box's edges from end to end, on both of their sides
    assert np.linalg.norm(along[creases, 1] - along[creases, 0], axis=1).sum() == pytest.approx(2 * 4 * 2.4)
    wave = 2 * np.pi / (8 * texel) * along[creases].sum(axis=-1)
    # the phase of the wave whose crest is in an edge's middle
    departure = 1 - np.cos((wave[:, 1] - wave[:, 0]) / 2)
    assert departure.max() < 0.02


def test_a_surface_counts_v_from_below_and_a_model_from_above(vertices):
    attributes = vertices.attributes[:4].copy()
    attributes[:, UV] = [[0, 0], [1, 0], [0.25, 1], [0.5, 0.75]]
    own = mapped_coordinates(attributes, Mapping(own=True))
    np.testing.assert_allclose(own, [[0, 1, 0], [1, 1, 0], [0.25, 0, 0], [0.5, 0.25, 0]])
    by_place = mapped_coordinates(attributes, Mapping(scale=np.array([1.0, 2.0, 4.0])))
    np.testing.assert_allclose(by_place, attributes[:, POSITION] * [1, 2, 4])
