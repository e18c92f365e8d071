"""A mesh cut for its charts is drawn as round as it was, and as sharp."""

import numpy as np
import trimesh

from ripple_sim.render.surfaces.vertices import rounded_parts
from ripple_sim.solver import Mesh, build_atlas


def parts_of(shape: trimesh.Trimesh):
    mesh = Mesh.from_arrays(shape.vertices, shape.faces)
    atlas = build_atlas(mesh, 16, layout="patches", cache=False)
    rounded = rounded_parts(mesh, atlas.chart_map)
    assert len(rounded.parts.F) > 1.2 * len(mesh.F), "triangles were cut"
    return rounded


def test_a_cut_ball_stays_round():
    """Flat triangles of this ball lie up to 2 % under it, quadratic patches a tenth of that."""
    parts, V, normals = parts_of(trimesh.creation.icosphere(subdivisions=2))
    assert np.linalg.norm(parts.V, axis=1).min() < 0.983
    assert np.abs(np.linalg.norm(V, axis=1) - 1).max() < 2e-3
    radial = V[parts.F] / np.linalg.norm(V[parts.F], axis=2, keepdims=True)
    assert np.einsum("fcj,fcj->fc", normals, radial).min() > np.cos(np.radians(1.0))


def test_corners_that_meet_have_the_same_normal_to_the_last_bit():
    parts, _, normals = parts_of(trimesh.creation.icosphere(subdivisions=2))
    _, vertex = np.unique(parts.F, return_inverse=True)
    distinct = np.unique(np.column_stack([vertex.ravel(), normals.reshape(-1, 3)]), axis=0)
    assert len(distinct) == len(parts.V)


def test_a_cut_box_stays_flat_with_sharp_edges():
    parts, V, normals = parts_of(trimesh.creation.box((1.0, 1.0, 1.0)).subdivide())
    np.testing.assert_allclose(V, parts.V, atol=1e-12)
    np.testing.assert_allclose(np.abs(normals).max(axis=2), 1.0, atol=1e-12)
