"""Images of an atlas: every pixel shows the texel that lies there."""

import numpy as np
import pytest

from ripple_sim.figures.atlas_painter import AtlasPainter, texel_stretch
from ripple_sim.solver import sphere_atlas


def test_stretch_is_one_on_a_sphere_and_even_on_average(animal):
    np.testing.assert_allclose(texel_stretch(sphere_atlas(3.0, 16)), 1)
    stretch = texel_stretch(animal)
    assert stretch.min() < 0.95
    assert 1.05 < stretch.max() < 4
    # area-weighted quantiles agree with those of the mesh's triangles
    order = np.argsort(stretch.ravel())
    share = np.cumsum(animal.areas.ravel()[order]) / animal.areas.sum()
    assert stretch.ravel()[order][np.searchsorted(share, 0.5)] == pytest.approx(animal.quality()["q50"], abs=0.05)


def test_pictures_show_the_texel_that_lies_there():
    n = 8
    atlas = sphere_atlas(1.0, n)
    numbers = np.arange(6 * n * n).reshape(6, n, n)
    colors = np.stack([numbers % 16, numbers // 16 % 16, numbers // 256], axis=-1) / 16
    cross = AtlasPainter(atlas, colors).cross(64)
    assert cross.shape == (192, 256, 4)
    # face -y stands in the middle of the cross, second from the left, row 0 at the bottom
    for row, column in ((0, 0), (3, 5), (7, 7)):
        pixel = cross[127 - (row * 8 + 4), 64 + column * 8 + 4]
        np.testing.assert_allclose(pixel[:3], colors[3, row, column], atol=1e-9)
    assert cross[10, 10, 3] == 0


def test_neighbouring_faces_of_the_cross_belong_together():
    atlas = sphere_atlas(1.0, 16)
    smooth = (atlas.positions + 1) / 2
    cross = AtlasPainter(atlas, smooth).cross(32)[..., :3]
    middle = cross[48, 4::8]  # along the belt, where colours go round the sphere and are slot_scratch far apart
    assert np.abs(np.diff(middle, axis=0)).max() < 0.4
    # above and below the face -y
    np.testing.assert_allclose(cross[30, 48], cross[33, 48], atol=0.2)
    np.testing.assert_allclose(cross[62, 48], cross[66, 48], atol=0.2)
