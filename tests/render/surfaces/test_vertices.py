"""Vertices of a target are as round and as sharp as its mesh, and look heights up in one place."""

import mujoco
import numpy as np
import pytest
import trimesh
from drawn import ball_surface

from ripple_sim.coupling import target_atlas
from ripple_sim.render import surfaces
from ripple_sim.render.surfaces import POSITION, Charts, Surface
from ripple_sim.render.visuals import TextureMapping
from ripple_sim.solver import Mesh, build_atlas


@pytest.fixture(scope="module")
def vertices():
    return surfaces.surface_vertices(ball_surface("clay", 0.5), 0.2, 100)


def test_vertices_and_midpoints_lie_on_the_ball_and_point_outwards(vertices):
    position = vertices.attributes[:, POSITION]
    # an edge of the mesh bulges out to a cubic close to the arc
    np.testing.assert_allclose(np.linalg.norm(position, axis=1), 0.5, atol=2e-3)
    outwards = position / np.linalg.norm(position, axis=1, keepdims=True)
    for columns in (surfaces.DIRECTION, surfaces.NORMAL):
        vectors = vertices.attributes[:, columns]
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, atol=1e-9)
        np.testing.assert_allclose(vectors, outwards, atol=0.02)  # a degree
    np.testing.assert_allclose(vertices.attributes[:, surfaces.BAKED][:, 0], 1.0, atol=1e-5)


def test_heights_at_one_point_are_looked_up_in_one_place(vertices):
    """Also at midpoints of edges along a border."""
    points = np.concatenate(
        [vertices.attributes[:, POSITION], vertices.attributes[:, surfaces.DIRECTION]], axis=1
    )
    _, point = np.unique(points, axis=0, return_inverse=True)
    pairs = np.unique(np.column_stack([point.ravel(), vertices.lookups]), axis=0)
    assert len(pairs) == len(np.unique(point)) < len(points)
    # points are one where they are nearly one
    assert len(np.unique(points.round(9), axis=0)) == len(np.unique(point))


def test_midpoints_come_last_and_lie_halfway_on_the_map(vertices):
    count = len(vertices.edges.ends)
    coordinates = vertices.attributes[:, surfaces.COORDINATES]
    np.testing.assert_allclose(
        coordinates[-count:], coordinates[vertices.edges.ends].mean(axis=1), atol=1e-12
    )
    assert vertices.F.max() < len(coordinates) - count


def test_a_wave_over_the_edges_of_a_box_is_a_smooth_curve():
    """Of 8 texels a length, at the worst moment: its chords are off by less than a fiftieth."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="box" size=".5 .4 .3"/></worldbody></mujoco>'
    )
    atlas = target_atlas(model, 0, 32)
    surface = Surface(atlas.mesh.V, atlas.mesh.F, Charts.of(atlas), "clay")
    made = surfaces.surface_vertices(surface, 0.02, 40_000)
    half_sizes = np.array([0.5, 0.4, 0.3])
    ends = made.attributes[made.edges.ends][..., POSITION]
    # an edge of the box lies in two of its planes, with both ends
    in_plane = (np.abs(ends) > half_sizes - 1e-9).all(axis=1)
    creases = ends[in_plane.sum(axis=1) == 2]
    # the box's edges from end to end, on both of their sides
    lengths = np.linalg.norm(creases[:, 1] - creases[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(2 * 4 * 2 * half_sizes.sum())
    texel = np.sqrt(atlas.areas.mean())
    wave_number = 2 * np.pi / (8 * texel)
    phase = wave_number * creases.sum(axis=-1)
    # under a wave whose crest is in the middle of the edge
    departure = 1 - np.cos((phase[:, 1] - phase[:, 0]) / 2)
    assert departure.max() < 0.02


def test_v_of_surfaces_and_of_models_have_opposite_directions(vertices):
    attributes = vertices.attributes[:4].copy()
    attributes[:, surfaces.UV] = [[0, 0], [1, 0], [0.25, 1], [0.5, 0.75]]
    own = surfaces.mapped_coordinates(attributes, TextureMapping(own=True))
    np.testing.assert_allclose(own, [[0, 1, 0], [1, 1, 0], [0.25, 0, 0], [0.5, 0.25, 0]])
    by_place = surfaces.mapped_coordinates(
        attributes, TextureMapping(scale=np.array([1.0, 2.0, 4.0]))
    )
    np.testing.assert_allclose(by_place, attributes[:, POSITION] * [1, 2, 4])


def parts_of(shape: trimesh.Trimesh):
    mesh = Mesh.from_arrays(shape.vertices, shape.faces)
    atlas = build_atlas(mesh, 16, layout="patches", cache=False)
    rounded = surfaces.rounded_parts(mesh, atlas.chart_map)
    assert len(rounded[0].F) > 1.2 * len(mesh.F), "triangles were cut"
    return rounded


def test_a_cut_ball_stays_round_and_shared_corners_have_identical_normals():
    """Flat triangles of this ball lie up to 2 % under it, quadratic patches a tenth of that."""
    parts, V, normals = parts_of(trimesh.creation.icosphere(subdivisions=2))
    assert np.linalg.norm(parts.V, axis=1).min() < 0.983
    assert np.abs(np.linalg.norm(V, axis=1) - 1).max() < 2e-3
    corners = V[parts.F]
    radial = corners / np.linalg.norm(corners, axis=2, keepdims=True)
    cosines = np.einsum("fcj,fcj->fc", normals, radial)
    assert cosines.min() > np.cos(np.radians(1.0))
    _, vertex = np.unique(parts.F, return_inverse=True)
    distinct = np.unique(np.column_stack([vertex.ravel(), normals.reshape(-1, 3)]), axis=0)
    assert len(distinct) == len(parts.V)


def test_a_cut_box_stays_flat_with_sharp_edges():
    parts, V, normals = parts_of(trimesh.creation.box((1.0, 1.0, 1.0)).subdivide())
    np.testing.assert_allclose(V, parts.V, atol=1e-12)
    np.testing.assert_allclose(np.abs(normals).max(axis=2), 1.0, atol=1e-12)


def test_a_mesh_keeps_its_triangles():
    rng = np.random.default_rng(2)
    position = rng.random((40, 3))
    F = rng.permuted(np.tile(np.arange(40), (90, 1)), axis=1)[:, :3]
    ordered, vertices, _ = surfaces.memory_order(F, position)
    assert sorted(vertices[ordered].tolist()) == sorted(F.tolist())
    _, first = np.unique(ordered, return_index=True)
    assert (np.diff(first) > 0).all()  # vertices stand in the order of their first use
