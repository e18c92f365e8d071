"""Normals of a mesh's corners, and vertices split where they jump."""

import numpy as np

from ripple_sim.render.visuals import primitives
from ripple_sim.render.visuals.corners import corner_normals


def test_normals_are_smooth_below_the_crease_angle_and_sharp_above():
    cube = primitives.box(1)
    V, F = cube.positions(np.ones(3), np.full(3, 1e-9)), cube.faces
    big = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) > 1.0
    welded, index = np.unique(np.round(V, 6), axis=0, return_inverse=True)
    F = index.ravel()[F[big]]
    sharp = corner_normals(welded, F, crease=45.0)
    np.testing.assert_allclose(np.abs(sharp).max(axis=2), 1.0, atol=1e-12)
    smooth = corner_normals(welded, F, crease=180.0)
    np.testing.assert_allclose(smooth, welded[F] / np.sqrt(3), atol=1e-12)
