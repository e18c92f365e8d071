"""The skin follows the surface."""

import numpy as np
from played import RADIUS

from ripple_sim.solver import sphere_atlas
from ripple_sim.viewer.session import Session, Skin


def test_a_skin_is_the_surface_while_nothing_moves(session: Session) -> None:
    skin = session.skins["sphere"]
    np.testing.assert_allclose(np.linalg.norm(skin.points, axis=1), RADIUS, rtol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(skin.normals, axis=1), 1, rtol=1e-5)
    corners = skin.points[skin.F]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", outward, corners.mean(axis=1)) > 0).all()


def test_a_skin_follows_a_smooth_height_with_its_points_and_normals() -> None:
    atlas = sphere_atlas(1.0, 48)
    skin = Skin(atlas)
    rest, flat, height = skin.points.copy(), skin.normals.copy(), 0.02
    x, _, z = np.moveaxis(atlas.positions, -1, 0)
    skin.update((height * (x * z)).astype(np.float32))
    direction = rest / np.linalg.norm(rest, axis=1, keepdims=True)
    wave = height * direction[:, 0] * direction[:, 2]
    np.testing.assert_allclose(skin.height, wave, atol=2e-3 * height)
    np.testing.assert_allclose(np.linalg.norm(skin.points - rest, axis=1), np.abs(wave), atol=3e-3 * height)
    # gradient on the unit sphere of a x z: the plane gradient (z, 0, x) a without its radial part
    gradient = height * np.stack([direction[:, 2], np.zeros(len(rest)), direction[:, 0]], axis=1)
    gradient -= np.einsum("ij,ij->i", gradient, direction)[:, None] * direction
    tipped = flat - gradient
    tipped /= np.linalg.norm(tipped, axis=1, keepdims=True)
    assert np.linalg.norm(skin.normals - tipped, axis=1).max() < 0.02 * np.linalg.norm(tipped - flat, axis=1).max()
