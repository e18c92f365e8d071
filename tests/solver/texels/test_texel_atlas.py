"""Atlases of texel meshes without a triangle mesh, and the page that holds their charts."""

import numpy as np
import pytest
from hand_made import flat_torus, polygon, square

from ripple_sim.solver import texel_atlas
from ripple_sim.solver.texels.texel_atlas import ChartPage


def test_points_find_their_texels() -> None:
    for texels in (square(6), polygon(5, 6), polygon(3, 4), flat_torus(6)):
        atlas = texel_atlas(texels)
        assert atlas.mesh.area == pytest.approx(texels.areas.sum())
        found = atlas.nearest_texel(texels.positions.reshape(-1, 3))
        np.testing.assert_array_equal(found, np.arange(texels.topology.texel_count))
        chart, row, column = atlas.locate(texels.positions[0, 1, :3])
        assert (chart == 0).all()
        np.testing.assert_allclose(row, 1, atol=1e-9)
        np.testing.assert_allclose(column, [0, 1, 2], atol=1e-9)


PAGES = [ChartPage(1, 4), ChartPage(2, 4), ChartPage(5, 3), ChartPage(6, 8), ChartPage(17, 5)]


@pytest.mark.parametrize("page", PAGES)
def test_every_chart_has_a_block_of_its_own_on_the_page(page: ChartPage) -> None:
    width, height = page.size
    taken = np.zeros((height, width), int)
    for chart in range(page.charts):
        column, row = page.corner(chart)
        assert taken[row : row + page.resolution + 2, column : column + page.resolution + 2].size == page.block**2
        taken[row : row + page.block, column : column + page.block] += 1
    assert taken.max() == 1
    # no row of blocks stays empty
    assert taken[-1].any()


@pytest.mark.parametrize(
    ("charts", "size"), [(1, (10, 10)), (2, (20, 10)), (4, (20, 20)), (6, (30, 20)), (7, (30, 30))]
)
def test_the_page_is_about_as_high_as_wide(charts: int, size: tuple[int, int]) -> None:
    assert ChartPage(charts, 8).size == size


@pytest.mark.parametrize("page", PAGES)
def test_locating_a_place_gives_back_its_chart_row_and_column(page: ChartPage) -> None:
    rng = np.random.default_rng(0)
    chart, uv = rng.integers(0, page.charts, 200), rng.uniform(0, 1, (200, 2))
    uv[:4] = [[0, 0], [1, 0], [1, 1], [0, 1]]  # borders of a chart are still its own
    found, row, column = page.locate(page.places(chart, uv))
    np.testing.assert_array_equal(found, chart)
    np.testing.assert_allclose(np.stack([column, row], axis=1), page.resolution * uv - 0.5, atol=1e-9)


@pytest.mark.parametrize("page", PAGES)
def test_texel_centres_lie_in_the_middle_of_the_pages_texels(page: ChartPage) -> None:
    n = page.resolution
    for chart in range(page.charts):
        [[x, y]] = page.places(np.array([chart]), np.array([[0.5 / n, (n - 0.5) / n]]))
        column, row = page.corner(chart)
        # beyond the halo of one texel
        assert (x, y) == pytest.approx((column + 1.5, row + n + 0.5))
