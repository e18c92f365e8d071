"""Normals of the corners of meshes; ambient occlusion and thickness of known solids."""

import numpy as np
import pytest

from ripple_sim.render.visuals import bake, corner_normals, shapes, smooth_normals


def test_normals_are_smooth_below_the_crease_angle_and_sharp_above():
    cube = shapes.box(1)
    V = cube.positions(np.ones(3), np.full(3, 1e-9))
    F = cube.faces
    big = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) > 1.0
    welded, index = np.unique(np.round(V, 6), axis=0, return_inverse=True)
    F = index.ravel()[F[big]]
    sharp = corner_normals(welded, F, crease=45.0)
    np.testing.assert_allclose(np.abs(sharp).max(axis=2), 1.0, atol=1e-12)
    smooth = corner_normals(welded, F, crease=180.0)
    np.testing.assert_allclose(smooth, welded[F] / np.sqrt(3), atol=1e-12)


def test_triangles_share_normals_from_crease_to_crease():
    """A sheet folded along half a line: the fold has two sides and runs out smoothly."""
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


def test_nothing_hides_the_sky_from_a_ball():
    ball = shapes.ball(8)
    visibility, thickness, _ = bake(3.0 * ball.shell, ball.faces, ball.shell).T
    np.testing.assert_allclose(visibility, 1.0, atol=1e-6)
    # the mean chord of cosine-distributed rays into a ball is 4/3 of its radius
    np.testing.assert_allclose(thickness, 4 / 3, atol=0.04)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("flattening", [1.0, 0.3, 0.1])
def test_the_size_of_a_mesh_changes_nothing_and_a_flat_one_is_thin(flattening):
    ball = shapes.ball(6)
    V = ball.shell * [1.0, 1.0, flattening]
    normals = smooth_normals(V, ball.faces)
    first, second = (
        bake(scale * V + offset, ball.faces, normals) for scale, offset in ((1, 0), (1e-3, 5e-3))
    )
    np.testing.assert_allclose(first, second, atol=5e-3)
    assert first[:, 1].mean() < 4 / 3 * (0.4 if flattening == 0.1 else 1.1)


def test_a_wall_close_above_hides_the_sky_and_one_further_than_the_radius_does_not():
    """Two slabs over each other: their inner sides face one another."""
    slab = shapes.box(1)
    V = slab.positions(np.array([1.0, 1.0, 0.04]), np.full(3, 0.01))
    F = np.concatenate([slab.faces, slab.faces + len(V)])
    normals = np.concatenate([slab.shell, slab.shell])
    inner = np.concatenate([slab.core[:, 2] > 0, slab.core[:, 2] < 0]) & (
        np.abs(normals[:, 2]) > 0.99
    )
    assert inner.any()
    aside = np.array([0.0, 0.0, 0.5])
    near, far = (
        bake(np.concatenate([V - gap * aside, V + gap * aside]), F, normals)[:, 0]
        for gap in (0.2, 8.0)
    )
    # the smoothing mixes the corners of the inner sides with their edges, which see the sky
    assert near[inner].max() < 0.9
    assert near[inner].mean() < near[~inner].mean() - 0.1
    assert far.min() > 0.99


def test_both_sides_of_an_open_surface_see_their_own_surroundings():
    ball = shapes.ball(8)
    bowl = ball.faces[(ball.shell[ball.faces][:, :, 2] < 0.1).all(axis=1)]
    one = bake(ball.shell, bowl, ball.shell)
    turned = bake(ball.shell, bowl[:, ::-1], -ball.shell)
    used = np.unique(bowl)
    np.testing.assert_allclose(one[used, 2], turned[used, 0], atol=0.02)
    assert one[used, 2].max() < 0.97 < one[used, 0].min()


def test_a_vertex_without_triangles_has_finite_values():
    ball = shapes.ball(4)
    V = np.concatenate([ball.shell, [[0.0, 0.0, 1.5]]])
    normals = smooth_normals(V, ball.faces)
    assert not normals[-1].any()
    assert np.isfinite(bake(V, ball.faces, normals)).all()
