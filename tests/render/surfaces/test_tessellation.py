"""Tessellation, static and by what waves a frame shows: no gap opens, on the host or the GPU."""

import numpy as np
import pytest
from mujoco_models import posed
from sphere_height_maps import N, constant_height_map, cube_charts, height_map_of

from ripple_sim.render import Camera, Renderer, Surface, surfaces
from ripple_sim.render.surfaces import COORDINATES, POSITION, adaptive
from ripple_sim.render.visuals import shapes, triangle_normals
from ripple_sim.solver import HeightMap, sphere_atlas
from ripple_sim.solver.backends import DeviceField
from ripple_sim.solver.layouts.cube import cube_chart_points
from ripple_sim.solver.mesh import edges_of
from ripple_sim.solver.texels import ChartPage


def refine(V, F, normals, same=None, **limits):
    attributes = np.concatenate([V, normals, 2 * V], axis=1)
    same = np.arange(len(V)) if same is None else same
    F, finer, _ = surfaces.tessellate(F, attributes, same, **limits)
    return F, finer, attributes


def test_subdivision_splits_long_edges_opens_no_gap_and_rounds_a_ball():
    ball = shapes.ball(3)
    F, finer, attributes = refine(
        ball.shell, ball.faces, ball.shell, max_length=0.1, max_faces=20_000
    )
    edges = np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]])
    np.testing.assert_array_equal(np.unique(edges, axis=0), np.unique(edges[:, ::-1], axis=0))
    assert np.linalg.norm(finer[edges[:, 0], :3] - finer[edges[:, 1], :3], axis=1).max() <= 0.1
    np.testing.assert_array_equal(finer[: len(attributes)], attributes)
    # the coarse triangles' middles lie up to 0.06 under the sphere
    np.testing.assert_allclose(np.linalg.norm(finer[:, :3], axis=1), 1.0, atol=7e-3)
    np.testing.assert_allclose(finer[:, 3:6], finer[:, :3], atol=0.02)


def test_subdivision_keeps_creases_and_flat_faces_as_they_are():
    """A cube with vertices split at its edges; a seam of texture coordinates cuts one face."""
    cube = shapes.box(1)
    V = cube.positions(np.ones(3), np.full(3, 1e-9))
    F = cube.faces
    large = np.linalg.norm(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]), axis=1) > 1.0
    corners = V[F[large]].reshape(-1, 3).round(6)
    normals = np.repeat(triangle_normals(V, F[large]), 3, axis=0)
    fine, finer, _ = refine(
        corners, np.arange(len(corners)).reshape(-1, 3), normals, max_length=0.3, max_faces=5000
    )
    np.testing.assert_allclose(np.abs(finer[:, :3]).max(axis=1), 1.0, atol=1e-12)
    cross = np.cross(
        finer[fine[:, 1], :3] - finer[fine[:, 0], :3], finer[fine[:, 2], :3] - finer[fine[:, 0], :3]
    )
    assert np.linalg.norm(cross, axis=1).sum() / 2 == pytest.approx(24.0, rel=1e-9)


def test_a_seam_of_texture_coordinates_is_no_crease():
    ball = shapes.ball(4)
    # every triangle has vertices of its own, which differ in nothing that counts
    V = ball.shell[ball.faces].reshape(-1, 3)
    F = np.arange(3 * len(ball.faces)).reshape(-1, 3)
    seams = refine(V, F, V, same=ball.faces.ravel(), max_length=0.2, max_faces=5000)[1][:, :3]
    whole = refine(ball.shell, ball.faces, ball.shell, max_length=0.2, max_faces=5000)[1][:, :3]
    np.testing.assert_allclose(
        np.unique(seams.round(12), axis=0), np.unique(whole.round(12), axis=0), atol=1e-11
    )


def test_subdivision_stops_at_the_budget():
    ball = shapes.ball(8)
    F = refine(ball.shell, ball.faces, ball.shell, max_length=1e-3, max_faces=5000)[0]
    assert 2500 < len(F) <= 5000


def ball(tolerance, min_length=0.0):
    """A refined ball whose triangles share no vertices: each edge is a seam; and all vertices."""
    shape = shapes.ball(12)
    V = shape.shell[shape.faces].reshape(-1, 3)
    _, same = np.unique(V.round(9), axis=0, return_inverse=True)
    V = V[np.unique(same, return_index=True)[1]][same.ravel()]
    attributes = np.concatenate([V, V, V], axis=1)
    F = np.arange(len(V)).reshape(-1, 3)
    edges = edges_of(F)
    _, inner = surfaces.welded(edges, F, same.ravel())
    vertices = np.concatenate([attributes, surfaces.midpoints(edges.ends, inner, attributes)])
    page = ChartPage(6, N)
    chart, row, column = cube_chart_points(vertices[:, COORDINATES], N)
    places = page.places(chart, (np.stack([column, row], axis=1) + 0.5) / N)
    made = surfaces.SurfaceVertices(F, vertices, edges, places, places, np.zeros((0, 4)), F)
    adaptive = surfaces.AdaptiveTessellation(made, page, tolerance, min_length)
    return adaptive, vertices, F


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
    # each is drawn
    np.testing.assert_array_equal(np.unique(triangles), np.arange(refine.base_count + len(used)))
    triangles = np.append(np.arange(refine.base_count), used)[triangles]
    assert len(F) < len(triangles) < 4 * len(F)
    _, place = np.unique(vertices[:, POSITION], axis=0, return_inverse=True)
    closed = place.ravel()[triangles]
    sides = np.concatenate([closed[:, [0, 1]], closed[:, [1, 2]], closed[:, [2, 0]]])
    assert len(np.unique(sides, axis=0)) == len(sides)
    np.testing.assert_array_equal(np.unique(sides, axis=0), np.unique(sides[:, ::-1], axis=0))
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
    longest = np.linalg.norm(
        vertices[F, POSITION] - vertices[np.roll(F, 1, axis=1), POSITION], axis=2
    ).max()
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
    ends = edges_of(np.arange(base).reshape(-1, 3)).ends
    at = height(
        vertices[:, COORDINATES] / np.linalg.norm(vertices[:, COORDINATES], axis=1, keepdims=True)
    )
    departure = np.abs(at[base:] - at[ends].mean(axis=1))
    split = np.isin(base + np.arange(len(ends)), used)
    # along the cube's edges grid lines kink, and the spline of so coarse a height map is further
    # from the wave
    across = np.sort(np.abs(vertices[base:, COORDINATES]), axis=1)
    inside = across[:, 1] < 0.8 * across[:, 2]
    assert departure[inside & split].min() > 0.8 * tolerance
    assert departure[inside & ~split].max() < 1.2 * tolerance
    assert 0.1 < split[inside].mean() < 0.9


# so high that there are edges to be split
RESOLUTION = 16
SIZE = (120, 480)


@pytest.fixture(scope="module")
def scene(gl):
    """A renderer of a ball, its atlas, and a function that draws heights from host or GPU."""
    balls = (
        '<geom type="sphere" size=".5" pos="0 0 .5"/><geom type="sphere" size=".1" pos=".5 .4 .9"/>'
    )
    model, data = posed(
        f'<mujoco><worldbody><geom type="plane" size="3 3 .1"/>{balls}</worldbody></mujoco>'
    )
    ball = shapes.ball(16)
    atlas = sphere_atlas(1.0, RESOLUTION)
    height_map = HeightMap(atlas.texels)
    targets = {
        1: Surface(0.5 * ball.shell, ball.faces, cube_charts(ball.shell, RESOLUTION), "rubber")
    }
    with Renderer(gl, model, targets, size=SIZE) as renderer:

        def frame(heights, on_device):
            if on_device:
                with gl as ctx:
                    addresses = ctx.buffer(np.arange(heights.size, dtype=np.int32).tobytes())
                    heights = DeviceField.gathered(
                        gl, heights.shape, addresses, ctx.buffer(heights.tobytes())
                    )
            return renderer.render(
                data, {1: height_map(heights)}, Camera((0, 0, 0.5), 2.0, 60.0, -20.0)
            ).astype(int)

        yield renderer, atlas, frame


@pytest.mark.parametrize("group", [32, 256])
def test_tessellation_on_the_gpu_gives_the_triangles_of_the_cpu_in_order(
    gl, scene, group, monkeypatch
) -> None:
    monkeypatch.setattr(adaptive, "_GROUP", group)  # of 32 there are more than a group has threads
    renderer, atlas, frame = scene
    (target,) = renderer._scene.targets
    host = target._adaptive
    target._on_device = None
    for seed, depth in ((0, 0.0), (1, 0.02), (2, 0.2)):
        noise = (
            np.random.default_rng(seed)
            .normal(0.0, 1.0, (6, RESOLUTION, RESOLUTION))
            .astype(np.float32)
        )
        heights = np.float32(depth) * noise * (np.abs(noise) > 1)
        frame(heights, True)
        triangles, used = host(HeightMap(atlas.texels)(heights))
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
