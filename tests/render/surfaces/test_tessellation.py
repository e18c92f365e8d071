"""Tessellation of a mesh at rest and under waves, on the CPU and the GPU: no gap opens."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import pytest
from mujoco_models import posed
from sphere_height_maps import N, constant_height_map, cube_charts, height_map_of
from triangles import areas, cross_products, directed_edges, place_numbers

from ripple_sim.render import Camera, Renderer, Surface, surfaces
from ripple_sim.render.surfaces import COORDINATES, NORMAL, POSITION, adaptive
from ripple_sim.render.visuals import shapes, triangle_normals
from ripple_sim.solver import Atlas, HeightMap, sphere_atlas
from ripple_sim.solver.backends import DeviceField
from ripple_sim.solver.layouts.cube import cube_chart_points
from ripple_sim.solver.mesh import edges_of
from ripple_sim.solver.texels import ChartPage

# [texels] along a chart of the drawn ball: so many that there are edges to be split
RESOLUTION = 16
SIZE = (120, 480)

PIT = np.array([0.0, 0.6, 0.8])  # the direction of a pit's middle


class Refined(NamedTuple):
    """Triangles after subdivision, and the attributes of the vertices after and before it."""

    F: np.ndarray
    attributes: np.ndarray
    before: np.ndarray

    def positions(self) -> np.ndarray:
        return self.attributes[:, POSITION]


def subdivided(V, F, normals, same=None, **limits) -> Refined:
    before = np.concatenate([V, normals, 2 * V], axis=1)
    same = np.arange(len(V)) if same is None else same
    F, attributes, _ = surfaces.tessellate(F, before, same, **limits)
    return Refined(F, attributes, before)


def test_subdivision_splits_long_edges_opens_no_gap_and_rounds_a_ball():
    ball = shapes.ball(3)
    fine = subdivided(ball.shell, ball.faces, ball.shell, max_length=0.1, max_faces=20_000)
    edges = directed_edges(fine.F)
    np.testing.assert_array_equal(np.unique(edges, axis=0), np.unique(edges[:, ::-1], axis=0))
    ends = fine.positions()[edges]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max() <= 0.1
    np.testing.assert_array_equal(fine.attributes[: len(fine.before)], fine.before)
    # the coarse triangles' middles lie up to 0.06 under the sphere
    np.testing.assert_allclose(np.linalg.norm(fine.positions(), axis=1), 1.0, atol=7e-3)
    np.testing.assert_allclose(fine.attributes[:, NORMAL], fine.positions(), atol=0.02)


def test_subdivision_keeps_creases_and_flat_faces_as_they_are():
    """A cube with vertices split at its edges; a seam of texture coordinates cuts one face."""
    cube = shapes.box(1)
    V = cube.positions(np.ones(3), np.full(3, 1e-9))
    # without the slivers that round the edges
    faces = cube.faces[2 * areas(V[cube.faces]) > 1.0]
    corners = V[faces].reshape(-1, 3).round(6)
    normals = np.repeat(triangle_normals(V, faces), 3, axis=0)
    F = np.arange(len(corners)).reshape(-1, 3)
    fine = subdivided(corners, F, normals, max_length=0.3, max_faces=5000)
    np.testing.assert_allclose(np.abs(fine.positions()).max(axis=1), 1.0, atol=1e-12)
    assert areas(fine.positions()[fine.F]).sum() == pytest.approx(24.0, rel=1e-9)


def test_a_seam_of_texture_coordinates_is_no_crease():
    ball = shapes.ball(4)
    # every triangle has vertices of its own, which differ in nothing that counts
    V = ball.shell[ball.faces].reshape(-1, 3)
    F = np.arange(3 * len(ball.faces)).reshape(-1, 3)
    limits = {"max_length": 0.2, "max_faces": 5000}
    with_seams = subdivided(V, F, V, same=ball.faces.ravel(), **limits).positions()
    whole = subdivided(ball.shell, ball.faces, ball.shell, **limits).positions()
    np.testing.assert_allclose(
        np.unique(with_seams.round(12), axis=0), np.unique(whole.round(12), axis=0), atol=1e-11
    )


def test_subdivision_stops_at_the_budget():
    ball = shapes.ball(8)
    fine = subdivided(ball.shell, ball.faces, ball.shell, max_length=1e-3, max_faces=5000)
    assert 2500 < len(fine.F) <= 5000


class SeamedBall(NamedTuple):
    """A ball whose triangles share no vertices, so that each edge is a seam."""

    refine: surfaces.AdaptiveTessellation
    vertices: np.ndarray  # attributes of all vertices, the midpoints of the edges last
    F: np.ndarray


def seamed_ball(tolerance: float, min_length: float = 0.0) -> SeamedBall:
    shape = shapes.ball(12)
    V = shape.shell[shape.faces].reshape(-1, 3)
    _, first, same = np.unique(V.round(9), axis=0, return_index=True, return_inverse=True)
    V = V[first][same.ravel()]  # equal to the last bit
    attributes = np.concatenate([V, V, V], axis=1)
    F = np.arange(len(V)).reshape(-1, 3)
    edges = edges_of(F)
    _, inner = surfaces.welded(edges, F, same.ravel())
    vertices = np.concatenate([attributes, surfaces.midpoints(edges.ends, inner, attributes)])
    page = ChartPage(6, N)
    chart, row, column = cube_chart_points(vertices[:, COORDINATES], N)
    places = page.places(chart, (np.stack([column, row], axis=1) + 0.5) / N)
    made = surfaces.SurfaceVertices(F, vertices, edges, places, places, np.zeros((0, 4)), F)
    refine = surfaces.AdaptiveTessellation(made, page, tolerance, min_length)
    return SeamedBall(refine, vertices, F)


def pit(width, depth=0.1):
    def height(d):
        return -depth * np.exp(-((np.linalg.norm(d - PIT, axis=-1) / width) ** 2))

    return height_map_of(height, np.zeros_like)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("min_length", [0.0, 0.13])
def test_no_gap_opens_for_any_height_map(seed, min_length):
    rng = np.random.default_rng(seed)
    heights = rng.normal(0.0, 0.01, (6, N, N)) * (rng.random((6, N, N)) < 0.1 * (seed + 1))
    ball = seamed_ball(0.001, min_length)
    triangles, used = ball.refine(height_map_of(lambda d: heights, np.zeros_like))
    base_count = ball.refine.base_count
    # every vertex in use is drawn
    np.testing.assert_array_equal(np.unique(triangles), np.arange(base_count + len(used)))
    triangles = np.append(np.arange(base_count), used)[triangles]
    assert len(ball.F) < len(triangles) < 4 * len(ball.F)
    place = place_numbers(ball.vertices[:, POSITION])
    edges = directed_edges(place[triangles])
    assert len(np.unique(edges, axis=0)) == len(edges)
    np.testing.assert_array_equal(np.unique(edges, axis=0), np.unique(edges[:, ::-1], axis=0))
    corners = ball.vertices[:, POSITION][triangles]
    facing = cross_products(corners)
    assert (np.einsum("ij,ij->i", facing, corners.mean(axis=1)) > 0).all()


def test_a_still_or_lifted_surface_has_the_triangles_of_its_mesh():
    ball = seamed_ball(1e-5)
    for height in (0.0, 0.3):
        triangles, used = ball.refine(constant_height_map(height))
        np.testing.assert_array_equal(triangles, ball.F)
        assert len(used) == 0


def test_a_pit_is_refined_and_nothing_else():
    tolerance = 0.002
    ball = seamed_ball(tolerance)
    triangles, used = ball.refine(pit(0.15))
    distance = np.linalg.norm(ball.vertices[used, POSITION] - PIT, axis=1)
    assert len(used) > 20
    assert distance.max() < 0.5
    assert len(triangles) < 1.3 * len(ball.F)
    # a pit too shallow to be seen is not refined
    _, used_by_shallow = ball.refine(pit(0.15, depth=tolerance))
    assert len(used_by_shallow) == 0
    # nor a pit whose edges are short enough
    corners = ball.vertices[ball.F, POSITION]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    _, used_beyond_longest = seamed_ball(tolerance, 1.01 * longest).refine(pit(0.15))
    assert len(used_beyond_longest) == 0
    _, fewer = seamed_ball(tolerance, 0.9 * longest).refine(pit(0.15))
    assert 0 < len(fewer) < len(used)
    assert np.isin(fewer, used).all()


def test_edges_are_split_where_waves_depart_from_them():
    def height(d):
        return 0.1 * np.sin(3.0 * d[..., 2])

    tolerance = 1.2e-3
    ball = seamed_ball(tolerance)
    _, used = ball.refine(height_map_of(height, np.zeros_like))
    base_count = ball.refine.base_count
    coordinates = ball.vertices[:, COORDINATES]
    directions = coordinates / np.linalg.norm(coordinates, axis=1, keepdims=True)
    heights = height(directions)
    ends = edges_of(np.arange(base_count).reshape(-1, 3)).ends
    departure = np.abs(heights[base_count:] - heights[ends].mean(axis=1))
    is_split = np.isin(base_count + np.arange(len(ends)), used)
    # along the cube's edges grid lines kink, and the spline of so coarse a height map is further
    # from the wave
    sorted_coordinates = np.sort(np.abs(coordinates[base_count:]), axis=1)
    is_inside = sorted_coordinates[:, 1] < 0.8 * sorted_coordinates[:, 2]
    # the spline of the heights differs from the wave by a fifth of the tolerance at most
    assert departure[is_inside & is_split].min() > 0.8 * tolerance
    assert departure[is_inside & ~is_split].max() < 1.2 * tolerance
    assert 0.1 < is_split[is_inside].mean() < 0.9


class DrawnBall(NamedTuple):
    renderer: Renderer
    atlas: Atlas
    frame: Callable  # draws heights [6, n, n] from the host or the GPU


@pytest.fixture(scope="module")
def drawn_ball(gl) -> Iterator[DrawnBall]:
    model, data = posed(
        """<mujoco><worldbody>
        <geom type="plane" size="3 3 .1"/>
        <geom type="sphere" size=".5" pos="0 0 .5"/>
        <geom type="sphere" size=".1" pos=".5 .4 .9"/>
        </worldbody></mujoco>"""
    )
    camera = Camera((0, 0, 0.5), 2.0, 60.0, -20.0)
    ball = shapes.ball(16)
    atlas = sphere_atlas(1.0, RESOLUTION)
    height_map = HeightMap(atlas.texels)
    charts = cube_charts(ball.shell, RESOLUTION)
    targets = {1: Surface(0.5 * ball.shell, ball.faces, charts, "rubber")}
    with Renderer(gl, model, targets, size=SIZE) as renderer:

        def frame(heights, on_device):
            if on_device:
                with gl as ctx:
                    addresses = ctx.buffer(np.arange(heights.size, dtype=np.int32).tobytes())
                    buffer = ctx.buffer(heights.tobytes())
                    heights = DeviceField.gathered(gl, heights.shape, addresses, buffer)
            return renderer.render(data, {1: height_map(heights)}, camera).astype(int)

        yield DrawnBall(renderer, atlas, frame)


@pytest.mark.usefixtures("computes")
@pytest.mark.parametrize("group", [32, 256])
def test_tessellation_on_the_gpu_gives_the_triangles_of_the_cpu_in_order(
    gl, drawn_ball, group, monkeypatch
) -> None:
    monkeypatch.setattr(adaptive, "_GROUP", group)  # of 32 there are more than a group has threads
    (target,) = drawn_ball.renderer._scene.targets
    host = target._adaptive
    target._on_device = None
    for seed, depth in ((0, 0.0), (1, 0.02), (2, 0.2)):
        rng = np.random.default_rng(seed)
        noise = rng.normal(0.0, 1.0, (6, RESOLUTION, RESOLUTION)).astype(np.float32)
        heights = np.float32(depth) * noise * (np.abs(noise) > 1)
        drawn_ball.frame(heights, on_device=True)
        triangles, used = host(HeightMap(drawn_ball.atlas.texels)(heights))
        with gl:
            split = np.frombuffer(target._on_device.split.read(), np.int32)
            count = np.frombuffer(target._count.read(), np.int32)
            indices = np.frombuffer(target._indices.read(), np.int32)[: count[0]]
        np.testing.assert_array_equal(count[1:], [1, 0, 0, 0])
        # the host's midpoints are those in use alone
        numbers = np.append(np.arange(host.base_count), used)
        np.testing.assert_array_equal(indices.reshape(-1, 3), numbers[triangles])
        np.testing.assert_array_equal(np.flatnonzero(split) + host.base_count, used)
        assert (len(used) > 0) == (depth > 0)
