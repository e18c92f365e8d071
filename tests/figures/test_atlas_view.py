"""Images of an atlas: every pixel shows the texel that lies there, and looks at a surface."""

from pathlib import Path

import numpy as np
import pytest
from hand_made import polygon, square

from ripple_sim.figures import AtlasPainter, View, chart_colors, cross, squares, texel_stretch
from ripple_sim.figures.figure_file import save_plot
from ripple_sim.solver import AtlasError, sphere_atlas, texel_atlas


def test_stretch_is_one_on_a_sphere_and_even_on_average(animal):
    np.testing.assert_allclose(texel_stretch(sphere_atlas(3.0, 16)), 1)
    stretch = texel_stretch(animal)
    assert stretch.min() < 0.95
    assert 1.05 < stretch.max() < 4
    # area-weighted quantiles agree with those of the mesh's triangles
    order = np.argsort(stretch.ravel())
    share = np.cumsum(animal.areas.ravel()[order]) / animal.areas.sum()
    assert stretch.ravel()[order][np.searchsorted(share, 0.5)] == pytest.approx(
        animal.quality()["q50"], abs=0.05
    )


def test_every_pixel_of_the_cross_shows_its_texel():
    n = 8
    atlas = sphere_atlas(1.0, n)
    numbers = np.arange(6 * n * n).reshape(6, n, n)
    colors = np.stack([numbers % 16, numbers // 16 % 16, numbers // 256], axis=-1) / 16
    image = cross(AtlasPainter(atlas, colors), n, 64)
    assert image.shape == (192, 256, 4)
    # face -y stands in the middle of the cross, second from the left, row 0 at the bottom
    for row, column in ((0, 0), (3, 5), (7, 7)):
        pixel = image[127 - (row * 8 + 4), 64 + column * 8 + 4]
        np.testing.assert_allclose(pixel[:3], colors[3, row, column], atol=1e-9)
    assert image[10, 10, 3] == 0


def test_squares_stand_side_by_side_with_every_texel_in_its_place():
    atlas = texel_atlas(polygon(5, 8))
    numbers = np.arange(5 * 64).reshape(5, 8, 8)
    colors = np.stack([numbers % 16, numbers // 16 % 16, numbers // 256], axis=-1) / 16
    image = squares(AtlasPainter(atlas, colors), (5, 8, 8), 300, 200)
    pitch = 100  # three columns, two rows
    assert image.shape == (200, 300, 4)
    side = 88
    for chart, (top, left) in ((0, (0, 0)), (2, (0, 2)), (4, (1, 1))):
        pixel = image[
            top * pitch + side - 1 - int(2.5 / 8 * side), left * pitch + int(5.5 / 8 * side)
        ]
        np.testing.assert_allclose(pixel[:3], colors[chart, 2, 5], atol=1e-9)
    assert image[150, 250, 3] == 0


@pytest.mark.parametrize("texels", [polygon(5, 4), polygon(7, 4), square(4)])
def test_charts_that_meet_have_different_colours(texels):
    colors = chart_colors(texels.topology)
    meet = (
        texels.topology.corners[:, None, :, None] == texels.topology.corners[None, :, None, :]
    ).any(axis=(2, 3))
    different = np.abs(colors[:, None] - colors[None]).max(axis=2) > 0.05
    assert (different | ~meet | np.eye(len(colors), dtype=bool)).all()


def test_an_open_surface_is_painted_on_both_sides():
    atlas = texel_atlas(square(8))
    colors = np.broadcast_to([0.9, 0.2, 0.1], (1, 8, 8, 3))
    for elevation in (60.0, -60.0):
        image = AtlasPainter(atlas, colors).mesh(View(elevation=elevation, up="z"), 40)
        red = image[image[..., 3] > 0.99][:, 0].mean()
        green = image[image[..., 3] > 0.99][:, 1].mean()
        assert red > 2 * green
        assert red > 0.4


@pytest.mark.parametrize("up", ["y", "z"])
def test_the_up_axis_points_up(up):
    axes = View(azimuth=20, elevation=30, up=up).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    right, upwards, eye = axes[:, "xyz".index(up)]
    assert (right, upwards > 0.8, eye > 0.4) == (pytest.approx(0), True, True)


def test_a_picture_that_fails_on_the_way_leaves_the_older_one(monkeypatch, tmp_path):
    from matplotlib.figure import Figure

    path = tmp_path / "atlas.PNG"
    save_plot(Figure(), path)
    older = path.read_bytes()
    assert older.startswith(b"\x89PNG")
    for failure, said in (
        (OSError(28, "No space left on device"), "No space"),
        (KeyboardInterrupt("by hand"), "hand"),
    ):

        def half(self, place, failure=failure, **options):
            Path(place).write_bytes(older[: len(older) // 2])
            raise failure

        monkeypatch.setattr(Figure, "savefig", half)
        with pytest.raises((AtlasError, KeyboardInterrupt), match=said):
            save_plot(Figure(), path)
        assert [(each.name, each.read_bytes()) for each in tmp_path.iterdir()] == [
            (path.name, older)
        ]
