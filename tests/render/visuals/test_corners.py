"""Normals of a mesh's corners, and vertices split where they jump."""

import numpy as np

from ripple_sim.render.visuals import shapes
from ripple_sim.render.visuals.corners import corner_normals


def test_normals_are_smooth_below_the_crease_angle_and_sharp_above():
    cube = shapes.box(1)
    V, F = cube.positions(np.ones(3), np.full(3, 1e-9)), cube.faces
    big = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) > 1.0
    welded, index = np.unique(np.round(V, 6), axis=0, return_inverse=True)
    F = index.ravel()[F[big]]
    sharp = corner_normals(welded, F, crease=45.0)
    np.testing.assert_allclose(np.abs(sharp).max(axis=2), 1.0, atol=1e-12)
    smooth = corner_normals(welded, F, crease=180.0)
    np.testing.assert_allclose(smooth, welded[F] / np.sqrt(3), atol=1e-12)


def test_triangles_share_normals_from_crease_to_crease():
    """A sheet folded sharply along half of a line: the fold has two sides, and runs out smoothly at its end."""
    x, y = (a.ravel() for a in np.mgrid[-3:4, -3:4].astype(float))
    V = np.stack([x, y, np.abs(x) * np.clip(y, 0, None) * 0.8], axis=1)
    i = (np.arange(6)[:, None] * 7 + np.arange(6)).ravel()
    F = np.concatenate([np.stack([i, i + 7, i + 8], axis=1), np.stack([i, i + 8, i + 1], axis=1)])
    normals = corner_normals(V, F)
    sides = [len(np.unique(normals[21 + k == F], axis=0)) for k in range(7)]
    assert sides == [1, 1, 1, 1, 2, 2, 2]


def test_a_sharp_tip_keeps_the_normals_of_its_triangles():
    angle = 2 * np.pi * np.arange(24) / 24
    V = np.vstack([np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1), [0, 0, 4]])
    F = np.stack([np.arange(24), (np.arange(24) + 1) % 24, np.full(24, 24)], axis=1)
    normals = corner_normals(V, F)
    assert len(np.unique(normals[:, 2].round(9), axis=0)) == 24
    assert len(np.unique(normals[:, :2].reshape(-1, 3), axis=0)) == 24
