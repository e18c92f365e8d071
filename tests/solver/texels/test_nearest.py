"""The nearest places of compiled code are those of the atlas, in every layout."""

from collections.abc import Callable

import numpy as np
import pytest
from hand_made import polygon

from ripple_sim.scenes.shapes import limbed
from ripple_sim.solver import Atlas, Mesh, build_atlas, sphere_atlas, texel_atlas
from ripple_sim.solver.texels.chart_map import nearest_places


def limbed_atlas(layout: str) -> Atlas:
    return build_atlas(Mesh.from_arrays(*limbed(0.05)), 12, layout=layout, cache=False)


ATLASES: dict[str, Callable[[], Atlas]] = {
    "cube": lambda: limbed_atlas("cube"),
    "patches": lambda: limbed_atlas("patches"),
    "given": lambda: texel_atlas(polygon(5, 8)),
    "sphere": lambda: sphere_atlas(0.7, 9),
}


@pytest.mark.parametrize("layout", ATLASES)
def test_places_are_those_of_points_carried_to_the_charts(layout: str) -> None:
    atlas, rng = ATLASES[layout](), np.random.default_rng(0)
    n, size = atlas.resolution, np.ptp(atlas.mesh.V, axis=0).max()
    points = atlas.mesh.V[rng.integers(len(atlas.mesh.V), size=400)] + 0.02 * size * rng.standard_normal((400, 3))
    closest, texels = nearest_places(atlas.places, points)
    np.testing.assert_allclose(closest, atlas.project(points)[0], atol=1e-12)
    chart, row, column = atlas.locate(points)
    places = np.clip([row, column], 0, n - 1)
    found = np.array(np.unravel_index(texels, atlas.areas.shape))
    np.testing.assert_array_equal(found[0], chart)
    # half-way between two texels either will do
    assert np.abs(found[1:] - places).max() < 0.5 + 1e-9
