"""Static tessellation: no gaps, round where smooth, creases kept."""

import numpy as np
import pytest

from ripple_sim.render.surfaces.tessellation import tessellate
from ripple_sim.render.visuals import shapes
from ripple_sim.render.visuals.corners import triangle_normals


def directed_edges(F) -> np.ndarray:
    return np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])


def refine(V, F, normals, same=None, **limits):
    attributes = np.concatenate([V, normals, 2 * V], axis=1)
    same = np.arange(len(V)) if same is None else same
    F, finer, _ = tessellate(F, attributes, same, position=slice(0, 3), normal=slice(3, 6), **limits)
    return F, finer, attributes


def test_subdivision_splits_long_edges_opens_no_gap_and_rounds_a_ball():
    ball = shapes.ball(3)
    F, finer, attributes = refine(ball.shell, ball.faces, ball.shell, max_length=0.1, max_faces=20_000)
    edges = directed_edges(F)
    np.testing.assert_array_equal(np.unique(edges, axis=0), np.unique(edges[:, ::-1], axis=0))
    assert np.linalg.norm(finer[edges[:, 0], :3] - finer[edges[:, 1], :3], axis=1).max() <= 0.1
    np.testing.assert_array_equal(finer[: len(attributes)], attributes)
    # the coarse triangles' middles lie up to 0.06 under the sphere
    np.testing.assert_allclose(np.linalg.norm(finer[:, :3], axis=1), 1.0, atol=7e-3)
    np.testing.assert_allclose(finer[:, 3:6], finer[:, :3], atol=0.02)


def test_subdivision_keeps_creases_and_flat_faces_as_they_are():
    """A cube whose vertices are split at its edges, and one of whose faces is cut by a seam of texture coordinates."""
    cube = shapes.box(1)
    V, F = cube.positions(np.ones(3), np.full(3, 1e-9)), cube.faces
    large = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) > 1.0
    corners = V[F[large]].reshape(-1, 3).round(6)
    normals = np.repeat(triangle_normals(V, F[large]), 3, axis=0)
    fine, finer, _ = refine(corners, np.arange(len(corners)).reshape(-1, 3), normals, max_length=0.3, max_faces=5000)
    np.testing.assert_allclose(np.abs(finer[:, :3]).max(axis=1), 1.0, atol=1e-12)
    cross = np.cross(finer[fine[:, 1], :3] - finer[fine[:, 0], :3], finer[fine[:, 2], :3] - finer[fine[:, 0], :3])
    assert np.linalg.norm(cross, axis=1).sum() / 2 == pytest.approx(24.0, rel=1e-9)


def test_a_seam_of_texture_coordinates_is_no_crease():
    ball = shapes.ball(4)
    # every triangle has vertices of its own, which differ in nothing that counts
    V, F = ball.shell[ball.faces].reshape(-1, 3), np.arange(3 * len(ball.faces)).reshape(-1, 3)
    seams = refine(V, F, V, same=ball.faces.ravel(), max_length=0.2, max_faces=5000)[1][:, :3]
    whole = refine(ball.shell, ball.faces, ball.shell, max_length=0.2, max_faces=5000)[1][:, :3]
    np.testing.assert_allclose(np.unique(seams.round(12), axis=0), np.unique(whole.round(12), axis=0), atol=1e-11)


def test_subdivision_stops_at_the_budget():
    ball = shapes.ball(8)
    F = refine(ball.shell, ball.faces, ball.shell, max_length=1e-3, max_faces=5000)[0]
    assert 2500 < len(F) <= 5000
