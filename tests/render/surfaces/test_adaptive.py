"""Which triangles a frame needs: no gap opens, and only where waves are sharp are there more of them."""

import numpy as np
import pytest
from sphere_height_maps import N, constant_height_map, height_map_of

from ripple_sim.render.surfaces.adaptive import AdaptiveTessellation
from ripple_sim.render.surfaces.tessellation import edges_of, midpoints
from ripple_sim.render.surfaces.vertices import SurfaceVertices
from ripple_sim.render.visuals import shapes as meshes
from ripple_sim.solver.layouts.cube.convention import cube_chart_points
from ripple_sim.solver.texels.texel_atlas import ChartPage

POSITION, NORMAL, SPHERE = slice(0, 3), slice(3, 6), slice(6, 9)


def ball(tolerance, min_length=0.0):
    """A ball whose triangles share no vertices, so that each edge is a seam: its refinement, and all vertices."""
    shape = meshes.ball(12)
    V = shape.shell[shape.faces].reshape(-1, 3)
    _, same = np.unique(V.round(9), axis=0, return_inverse=True)
    V = V[np.unique(same, return_index=True)[1]][same.ravel()]
    attributes, F = np.concatenate([V, V, V], axis=1), np.arange(len(V)).reshape(-1, 3)
    edges = edges_of(F, same.ravel())
    vertices = np.concatenate([attributes, midpoints(edges, attributes, POSITION, NORMAL)])
    page = ChartPage(6, N)
    chart, row, column = cube_chart_points(vertices[:, SPHERE], N)
    places = page.places(chart, (np.stack([column, row], axis=1) + 0.5) / N)
    made = SurfaceVertices(F, vertices, edges, places, places, np.zeros((0, 4)), F)
    adaptive = AdaptiveTessellation(made, page, tolerance, min_length)
    return adaptive, vertices, F


def geometric(vertices, triangles):
    """Triangles by vertices that are the same where their positions are."""
    _, place = np.unique(vertices[:, POSITION], axis=0, return_inverse=True)
    return place.ravel()[triangles]


def pit(width, depth=0.1):
    def height(d):
        return -depth * np.exp(-((np.linalg.norm(d - [0.0, 0.6, 0.8], axis=-1) / width) ** 2))

    return height_map_of(height, np.zeros_like)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("min_length", [0.0, 0.13])
def test_no_gap_opens_for_any_height_map(seed, min_length):
    rng = np.random.default_rng(seed)
    heights = rng.normal(0.0, 0.01, (6, N, N)) * (rng.random((6, N, N)) < 0.1 * (seed + 1))
    refine, vertices, F = ball(0.001, min_length)
    triangles, used = refine(height_map_of(lambda d: heights, np.zeros_like))
    assert len(F) < len(triangles) < 4 * len(F)
    closed = geometric(vertices, triangles)
    sides = np.concatenate([closed[:, [0, 1]], closed[:, [1, 2]], closed[:, [2, 0]]])
    assert len(np.unique(sides, axis=0)) == len(sides)
    np.testing.assert_array_equal(np.unique(sides, axis=0), np.unique(sides[:, ::-1], axis=0))
    # what is drawn are the mesh's vertices and the midpoints in use, and each of these is drawn
    np.testing.assert_array_equal(np.unique(triangles), np.concatenate([np.arange(refine.base_count), used]))
    corners = vertices[:, POSITION][triangles]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", outward, corners.mean(axis=1)) > 0).all()


def test_a_still_or_lifted_surface_has_the_triangles_of_its_mesh():
    refine, _, F = ball(1e-5)
    for height in (0.0, 0.3):
        triangles, used = refine(constant_height_map(height))
        np.testing.assert_array_equal(triangles, F)
        assert len(used) == 0


def test_a_pit_is_refined_and_nothing_else():
    refine, vertices, F = ball(0.002)
    triangles, used = refine(pit(0.15))
    away = np.linalg.norm(vertices[used, POSITION] - [0.0, 0.6, 0.8], axis=1)
    assert len(used) > 20
    assert away.max() < 0.5
    assert len(triangles) < 1.3 * len(F)
    # one too shallow to be seen is not
    assert len(refine(pit(0.15, depth=0.002))[1]) == 0
    # nor one whose edges are short enough
    longest = np.linalg.norm(vertices[F, POSITION] - vertices[np.roll(F, 1, axis=1), POSITION], axis=2).max()
    assert len(ball(0.002, min_length=1.01 * longest)[0](pit(0.15))[1]) == 0
    fewer = ball(0.002, min_length=0.9 * longest)[0](pit(0.15))[1]
    assert 0 < len(fewer) < len(used)
    assert np.isin(fewer, used).all()


def test_edges_are_split_where_waves_depart_from_them():
    def height(d):
        return 0.1 * np.sin(3.0 * d[..., 2])

    tolerance = 1.2e-3
    refine, vertices, _ = ball(tolerance)
    _, used = refine(height_map_of(height, np.zeros_like))
    base = refine.base_count
    ends = edges_of(np.arange(base).reshape(-1, 3), np.arange(base)).ends
    at = height(vertices[:, SPHERE] / np.linalg.norm(vertices[:, SPHERE], axis=1, keepdims=True))
    departure = np.abs(at[base:] - at[ends].mean(axis=1))
    split = np.isin(base + np.arange(len(ends)), used)
    # along the cube's edges grid lines kink, and the spline of so coarse a height map is further from the wave
    across = np.sort(np.abs(vertices[base:, SPHERE]), axis=1)
    inside = across[:, 1] < 0.8 * across[:, 2]
    assert departure[inside & split].min() > 0.8 * tolerance
    assert departure[inside & ~split].max() < 1.2 * tolerance
    assert 0.1 < split[inside].mean() < 0.9


def test_same_height_map_gives_the_same_triangles():
    first, _, _ = ball(0.002)
    second, _, _ = ball(0.002)
    for _ in range(2):
        for a, b in zip(first(pit(0.1)), second(pit(0.1)), strict=True):
            np.testing.assert_array_equal(a, b)
