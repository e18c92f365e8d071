"""Displaced vertices in the world: splines on GPU and CPU, against a sum over texels."""

from typing import NamedTuple

import numpy as np
import pytest
from sphere_height_maps import cube_charts, height_map_of

from ripple_sim.render import HeightMapTextures
from ripple_sim.render.surfaces import (
    DIRECTION,
    POSITION,
    UV,
    Displacement,
    SurfaceVertices,
    spline_heights,
)
from ripple_sim.render.visuals import Occluders
from ripple_sim.solver.mesh import Edges
from ripple_sim.solver.texels import ChartPage

N = 8
PAGE = ChartPage(6, N)
HEIGHT = 3  # channel of a height map; the others are the gradient


class Place(NamedTuple):
    """Where a target is in the world."""

    rotation: np.ndarray
    origin: np.ndarray  # [m]
    occluders: int = 0


STILL = Place(np.eye(3), np.zeros(3))


class NoGeoms:
    geom_aabb = np.zeros((0, 6))
    geom_xmat = np.zeros((0, 9))
    geom_xpos = np.zeros((0, 3))


def vertices_at(
    chart, uv, positions=None, directions=None, midpoints=0, page=PAGE
) -> SurfaceVertices:
    """Vertices at places in charts; the last ones are midpoints, at least one is never used."""
    chart = np.append(chart, 0)
    uv = np.concatenate([uv, [[0.5, 0.5]]])
    midpoints += 1
    up = [0.0, 0.0, 1.0]
    attributes = np.zeros((len(chart), UV.stop))
    if positions is not None:
        attributes[:, POSITION] = [*positions, up]
    attributes[:, DIRECTION] = up if directions is None else [*directions, up]
    ends = np.zeros((midpoints, 2), dtype=np.int64)
    edges = Edges(ends, np.zeros((0, 3), dtype=np.int64), ends)
    places = page.places(np.asarray(chart), np.asarray(uv, dtype=float))
    none = np.zeros((0, 3), dtype=np.int64)
    return SurfaceVertices(none, attributes, edges, places, places, np.zeros((0, 4)), none)


def displaced(resources, vertices, height_map, place=STILL, used=(), page=PAGE) -> np.ndarray:
    """World positions and visibility [n, 4] as the GPU leaves them, NaN where it leaves nothing.

    First those of the mesh's own vertices, then those of the midpoints in use.
    """
    height_maps = HeightMapTextures(resources, [page])
    Occluders(resources, NoGeoms, np.zeros(0, dtype=np.int64)).bind(NoGeoms, np.zeros(3))
    with resources.gl:
        height_maps.write(0, height_map)
        height_maps.bind()
        mapped = np.zeros((len(vertices.attributes), 3))
        displacement = Displacement(resources, vertices, mapped, 0)
        displacement.moved.write(np.full(4 * len(mapped), np.nan, np.float32).tobytes())
        displacement.use(np.array(used, dtype=np.int32))
        displacement.run(*place)
        return np.frombuffer(displacement.moved.read(), np.float32).reshape(-1, 4)[:-1]


def random_height_map(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(6, N + 2, N + 2, 4)).astype(np.float32)


def random_places(count: int, seed: int):
    """Charts and places in them, some on borders and in corners."""
    rng = np.random.default_rng(seed)
    uv = rng.random((count, 2))
    uv[: count // 10, 0] = rng.integers(0, 2, count // 10)
    uv[: count // 20, 1] = rng.integers(0, 2, count // 20)
    return rng.integers(0, 6, count), uv


def spline_sum(height_map: np.ndarray, chart: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """The quadratic B-spline by its definition: a sum over all texels of a chart and its halo."""

    def weight(x):
        x = np.abs(x)
        return np.where(x < 0.5, 0.75 - x**2, np.where(x < 1.5, 0.5 * (1.5 - x) ** 2, 0.0))

    centres = np.arange(-1, N + 1)
    column, row = (N * uv - 0.5).T
    in_rows = weight(row[:, None] - centres)
    in_columns = weight(column[:, None] - centres)
    heights = height_map[chart, ..., HEIGHT].astype(np.float64)
    return np.einsum("ki,kj,kij->k", in_rows, in_columns, heights)


@pytest.mark.parametrize("seed", range(3))
def test_gpu_and_cpu_look_up_the_same_height(resources, seed):
    """Both against the definition; texture units of some drivers weigh texels with eight bits."""
    chart, uv = random_places(400, seed)
    height_map = random_height_map(seed)
    expected = spline_sum(height_map, chart, uv)
    height = displaced(resources, vertices_at(chart, uv), height_map)[:, 2]
    np.testing.assert_allclose(height, expected, atol=0.02)  # eight bits of weight
    place = PAGE.places(chart, uv)
    # a border belongs to its own chart
    on_chart, row, column = PAGE.locate(np.minimum(place, place - 1e-9))
    grid = np.stack([row, column], axis=1)
    nearest = np.clip(np.floor(grid + 0.5), 0, N - 1)
    texel = np.column_stack([on_chart, nearest]).astype(np.int32)
    own = spline_heights(height_map, texel, (grid - nearest).astype(np.float32))
    np.testing.assert_allclose(own, expected, atol=1e-5)


def test_the_height_is_the_same_from_both_charts_of_a_border(resources):
    """With the halo that the charts of a cube have.

    The middle of charts 0 and 2's common edge, and its neighbours.
    """
    directions = np.stack([np.ones(9), np.ones(9), np.linspace(-0.8, 0.8, 9)], axis=1)

    def height(d):
        return np.sin(5 * d[..., 0] - 3 * d[..., 1] + 4 * d[..., 2])

    height_map = height_map_of(height, np.zeros_like)
    charts = cube_charts(directions)
    values = []
    for chart in np.full((2, 9), [[0], [2]]):
        vertices = vertices_at(chart, charts.map.uv(directions, chart), page=charts.page)
        values.append(displaced(resources, vertices, height_map, page=charts.page)[:, 2])
    np.testing.assert_allclose(values[0], values[1], atol=1e-5)
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(values[0], height(unit), atol=0.05)  # a spline smooths the heights


def test_vertices_move_along_their_direction_and_then_into_the_world(resources):
    rng = np.random.default_rng(4)
    chart, uv = random_places(130, 4)
    positions, directions = rng.normal(size=(2, 130, 3))
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    origin = np.array([0.5, -2.0, 7.0])
    height_map = np.zeros((6, N + 2, N + 2, 4), np.float32)
    height_map[..., HEIGHT] = -0.3
    vertices = vertices_at(chart, uv, positions, directions)
    moved = displaced(resources, vertices, height_map, Place(rotation, origin))
    expected = (positions - 0.3 * directions) @ rotation.T + origin
    np.testing.assert_allclose(moved[:, :3], expected, atol=1e-5)
    np.testing.assert_array_equal(moved[:, 3], 1.0)  # nothing hides the sky


@pytest.mark.parametrize("used", [[], [67], [69, 64, 66]])
def test_only_midpoints_in_use_are_displaced(resources, used):
    chart, uv = random_places(70, 5)
    height_map = random_height_map(5)
    vertices = vertices_at(chart, uv, midpoints=6)
    moved = displaced(resources, vertices, height_map, used=used)
    every = displaced(resources, vertices_at(chart, uv), height_map)
    own = 64  # vertices of the mesh itself
    count = own + len(used)
    np.testing.assert_array_equal(moved[:count], every[[*range(own), *used]])
    assert np.isnan(moved[count:]).all()
