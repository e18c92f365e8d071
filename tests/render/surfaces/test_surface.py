"""The surface of a target: its look.

Cutting a mesh at the borders of its charts: nothing is lost, no gap opens, and every triangle has one chart.

Heatmaps: what they refuse.
"""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from drawn import FRONT, ball_surface, frame_of
from sphere_height_maps import cube_charts

from ripple_sim.render import LOOKS, Renderer, Surface
from ripple_sim.render.surfaces.surface import Charts, shared_places, split_at_charts, target_color
from ripple_sim.render.visuals import shapes
from ripple_sim.solver import RippleError
from ripple_sim.solver.layouts.cube.convention import CHART_NORMALS
from ripple_sim.solver.texels.texel_atlas import ChartPage


def test_the_model_look_takes_the_material_of_the_geom(gl):
    asset = '<material name="green" rgba="0 .8 0 1"/>'
    body = '<geom name="t" type="sphere" size=".5" pos="0 0 .5" material="green"/>'
    middle = np.s_[55:65, 75:85]
    shown = frame_of(gl, body, asset=asset, camera=FRONT, targets={"t": ball_surface("model")})[middle].mean(
        axis=(0, 1)
    )
    assert shown[1] > shown[0] + 60
    assert shown[1] > shown[2] + 60


@pytest.mark.parametrize(
    ("geom", "given", "shown"),
    [
        ("", None, LOOKS["jelly"].color),
        ('rgba="0.1 0.2 0.3 1"', None, (0.1, 0.2, 0.3)),
        ('material="green"', None, (0.0, 0.8, 0.0)),
        ('material="green" rgba="0.1 0.2 0.3 1"', None, (0.1, 0.2, 0.3)),
        ('material="checked"', None, LOOKS["jelly"].color),
        ('rgba="0.1 0.2 0.3 1"', (0.9, 0.8, 0.7), (0.9, 0.8, 0.7)),
        ('material="checked"', (0.9, 0.8, 0.7), (0.9, 0.8, 0.7)),
    ],
)
def test_a_colour_is_the_given_one_or_the_models_or_the_looks(geom, given, shown):
    """A video once took the look's colour where a loop of one's own took the geom's."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><material name="green" rgba="0 .8 0 1"/>'
        '<texture name="t" type="2d" builtin="checker" width="8" height="8"/><material name="checked" texture="t"/>'
        f'</asset><worldbody><geom type="sphere" size="0.5" {geom}/></worldbody></mujoco>'
    )
    assert target_color(model, 0, "jelly", given) == pytest.approx(shown)


def test_a_target_is_drawn_in_the_colour_of_its_geom(gl):
    body = '<geom name="t" type="sphere" size=".5" pos="0 0 .5" rgba="0 0.8 0 1"/>'
    shown = frame_of(gl, body, camera=FRONT, targets={"t": ball_surface("rubber")})[55:65, 75:85].mean(axis=(0, 1))
    assert shown[1] > shown[0] + 60
    assert shown[1] > shown[2] + 60


def test_unknown_look_names_the_valid_ones(gl):
    with pytest.raises(RippleError, match="'chrome'.*" + ".*".join(LOOKS)):
        frame_of(gl, '<geom name="t" type="sphere" size=".5"/>', targets={"t": ball_surface("chrome")})


def cut_at_charts(mesh, charts) -> SimpleNamespace:
    parts = split_at_charts(mesh, charts, slice(0, 3), slice(3, 6), slice(6, 9))
    return SimpleNamespace(**dict(zip(("F", "attributes", "same", "chart"), parts, strict=True)))


def turned(points: np.ndarray, seed: int) -> np.ndarray:
    """Points under a random rotation, so that triangles cross the borders askew."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return points @ (q * np.linalg.det(q))


def ball_mesh(divisions: int, seed: int):
    """F, attributes, same of a ball whose coordinates for the charts are its vertices' directions."""
    ball = shapes.ball(divisions)
    V = turned(ball.shell, seed)
    return ball.faces, np.concatenate([2 * V, V, V], axis=1), np.arange(len(V))


def facets(seed: int):
    """The same with hard edges: vertices stand once for each normal there."""
    F, attributes, _ = ball_mesh(3, seed)
    corners = attributes[F]
    cross = np.cross(corners[:, 1, :3] - corners[:, 0, :3], corners[:, 2, :3] - corners[:, 0, :3])
    corners[:, :, 3:6] = (cross / np.linalg.norm(cross, axis=1, keepdims=True))[:, None]
    flat = corners.reshape(-1, 9)
    _, first, number = np.unique(flat.round(12), axis=0, return_index=True, return_inverse=True)
    return number.reshape(-1, 3), flat[first], np.arange(len(first))


def areas(corners: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def welded(positions: np.ndarray, F: np.ndarray) -> np.ndarray:
    """Triangles by numbers that are the same where positions are, but for round-off."""
    _, place = np.unique(positions.round(9), axis=0, return_inverse=True)
    return place.ravel()[F]


MESHES = [*(pytest.param(ball_mesh(d, s), id=f"ball {d} {s}") for d, s in ((1, 0), (2, 1), (5, 2), (9, 3))),
          pytest.param(facets(4), id="facets")]  # fmt: skip


@pytest.mark.parametrize("mesh", MESHES)
def test_no_gap_opens_and_no_area_is_lost(mesh):
    F, attributes, _ = mesh
    cut = cut_at_charts(mesh, cube_charts(attributes[:, 6:]))
    assert len(cut.F) > len(F)
    before, after = areas(attributes[F][:, :, :3]), areas(cut.attributes[cut.F][:, :, :3])
    assert after.sum() == pytest.approx(before.sum(), rel=1e-10)
    closed = welded(cut.attributes[:, :3], cut.F)
    sides = np.concatenate([closed[:, [0, 1]], closed[:, [1, 2]], closed[:, [2, 0]]])
    directed, count = np.unique(sides, axis=0, return_counts=True)
    assert count.max() == 1
    np.testing.assert_array_equal(directed, np.unique(sides[:, ::-1], axis=0))


@pytest.mark.parametrize("mesh", MESHES)
def test_every_triangle_lies_in_one_chart(mesh):
    _, attributes, _ = mesh
    cut = cut_at_charts(mesh, cube_charts(attributes[:, 6:]))
    chart = cut.chart[cut.F]
    assert (chart == chart[:, :1]).all()
    # in its share of space the chart's own axis is the nearest of the six
    along = np.einsum("fki,ci->fkc", cut.attributes[cut.F][:, :, 6:], CHART_NORMALS)
    own = np.take_along_axis(along, chart[:, :, None], axis=2)[..., 0]
    assert (own >= along.max(axis=2) - 1e-9).all()
    assert set(np.unique(chart)) == set(range(6))


@pytest.mark.parametrize("mesh", MESHES)
def test_triangles_keep_their_side_and_vertices_their_unit_normals(mesh):
    _, attributes, _ = mesh
    cut = cut_at_charts(mesh, cube_charts(attributes[:, 6:]))
    corners = cut.attributes[cut.F]
    cross = np.cross(corners[:, 1, :3] - corners[:, 0, :3], corners[:, 2, :3] - corners[:, 0, :3])
    assert (np.einsum("fi,fi->f", cross, corners[:, :, :3].mean(axis=1)) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(cut.attributes[:, 3:6], axis=1), 1.0, atol=1e-9)
    assert (np.einsum("fi,fki->fk", cross, corners[:, :, 3:6]) > 0).all()


@pytest.mark.parametrize("mesh", MESHES)
def test_vertices_are_the_same_on_both_sides_of_a_border_and_nowhere_else(mesh):
    """Equal where position and normal are: a border is no crease, and a crease stays one."""
    _, attributes, _ = mesh
    cut = cut_at_charts(mesh, cube_charts(attributes[:, 6:]))
    _, by_value = np.unique(cut.attributes[:, :6].round(9), axis=0, return_inverse=True)
    pairs = np.unique(np.column_stack([by_value.ravel(), cut.same]), axis=0)
    assert len(np.unique(pairs[:, 0])) == len(pairs) == len(np.unique(pairs[:, 1]))
    # once for each chart, no more
    assert len(np.unique(np.column_stack([cut.attributes, cut.chart]), axis=0)) == len(cut.attributes)
    assert np.unique(cut.same, return_counts=True)[1].max() == 3  # at the cube's corners


def test_texture_coordinates_keep_their_jump_where_a_seam_crosses_a_border():
    """Two triangles with a common side over an edge of the cube: a texture ends on one side and begins on the other."""
    V = np.array([[1.0, 0.1, 0.5], [1.0, 0.1, -0.5], [0.5, -0.6, 1.0], [0.5, 0.8, 1.0], [0.5, 0.1, 1.0]])
    V = V[[0, 4, 2, 0, 4, 3]] * 2
    normal = np.tile([0.8, 0.0, 0.6], (6, 1))
    u = np.array([1.0, 1.0, 0.7, 0.0, 0.0, 0.3])
    attributes = np.column_stack([V, normal, V, u])
    mesh = np.array([[0, 2, 1], [3, 4, 5]]), attributes, np.array([0, 1, 2, 0, 1, 3])
    cut = cut_at_charts(mesh, cube_charts(attributes[:, 6:9]))
    assert len(np.unique(cut.chart)) == 2
    values = cut.attributes[cut.F][:, :, 9]
    assert ((values >= 0.7 - 1e-9).all(axis=1) | (values <= 0.3 + 1e-9).all(axis=1)).all()
    on_seam = (np.abs(cut.attributes[:, 1] - 0.2) < 1e-9) & (np.abs(cut.attributes[:, 0] - cut.attributes[:, 2]) < 1e-9)
    assert sorted(cut.attributes[on_seam, 9].round(9)) == [0.0, 0.0, 1.0, 1.0]
    assert len(np.unique(cut.same[on_seam])) == 1


def test_a_mesh_within_one_chart_stays_as_it_is():
    F, attributes, same = ball_mesh(8, 5)
    high = attributes[:, 8] > 0.85
    F = F[high[F].all(axis=1)]
    used, number = np.unique(F, return_inverse=True)
    cut = cut_at_charts((F, attributes, same), cube_charts(attributes[:, 6:]))
    np.testing.assert_array_equal(cut.F, number.reshape(-1, 3))
    np.testing.assert_array_equal(cut.attributes, attributes[used])
    np.testing.assert_array_equal(cut.same, same[used])
    assert (CHART_NORMALS[cut.chart] == [0, 0, 1]).all()


def test_a_long_triangle_over_a_corner_of_the_cube_has_a_part_in_each_chart_there():
    corners = np.array([[1.0, 0.1, 0.1], [0.1, 1.0, 0.1], [0.1, 0.1, 1.0]])
    normal = np.ones((3, 3)) / np.sqrt(3)
    directions = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    attributes = np.concatenate([corners, normal, directions], axis=1)
    cut = cut_at_charts((np.array([[0, 1, 2]]), attributes, np.arange(3)), cube_charts(directions))
    assert len(np.unique(cut.chart)) == 3
    part = areas(cut.attributes[cut.F][:, :, :3])
    whole = areas(corners[None])[0]
    for chart in np.unique(cut.chart):
        assert part[cut.chart[cut.F[:, 0]] == chart].sum() == pytest.approx(whole / 3)
    middle = np.linalg.norm(cut.attributes[:, :3] - corners.mean(axis=0), axis=1) < 1e-9
    assert middle.sum() == 3
    assert len(np.unique(cut.same[middle])) == 1


def test_heights_on_a_border_are_looked_up_in_one_place():
    mesh = ball_mesh(5, 6)
    charts = cube_charts(mesh[1][:, 6:], 10)
    cut = cut_at_charts(mesh, charts)
    uv = charts.map.uv(cut.attributes[:, 6:], cut.chart)
    places = charts.page.places(cut.chart, uv)
    shared = shared_places(uv, places, cut.same[:, None])
    for each in np.unique(cut.same):
        assert len(np.unique(shared[cut.same == each], axis=0)) == 1
    inside = (np.abs(uv - 0.5) < 0.499).all(axis=1)
    np.testing.assert_array_equal(shared[inside], places[inside])
    # the place is one of those that the point has on the page
    moved = np.flatnonzero((shared != places).any(axis=1))
    assert len(moved) > 20
    assert all((places[cut.same == cut.same[i]] == shared[i]).all(axis=1).any() for i in moved)


def test_points_inside_a_chart_share_nothing_even_where_they_coincide():
    uv = np.array([[0.5, 0.5], [0.2, 0.2], [1.0, 0.3], [0.0, 0.7], [0.4, 1.0 - 1e-12]])
    places = np.arange(10.0).reshape(5, 2)
    shared = shared_places(uv, places, np.array([[7], [7], [7], [7], [8]]))
    np.testing.assert_array_equal(shared[[0, 1, 2, 4]], places[[0, 1, 2, 4]])
    np.testing.assert_array_equal(shared[3], places[2])
    assert shared_places(uv[:2], places[:2], np.zeros((2, 1))) is not places  # the input stays as it is


@pytest.mark.parametrize("shape", [(1, 4, 4), (6, 8, 8), (7, 3, 3)])
def test_the_page_has_room_for_every_chart_with_its_halo(shape):
    charts = Charts(None, shape)
    assert charts.page == ChartPage(shape[0], shape[1])
    assert charts.halo_shape == (shape[0], shape[1] + 2, shape[2] + 2)
    width, height = charts.page.size
    taken = np.zeros((height, width), dtype=int)
    for chart in range(shape[0]):
        column, row = charts.page.corner(chart)
        taken[row : row + charts.halo_shape[1], column : column + charts.halo_shape[2]] += 1
    assert taken.max() == 1
    assert taken.sum() == np.prod(charts.halo_shape)


COLORS = np.arange(9, dtype=np.uint8).reshape(3, 3)


def test_what_is_no_heatmap_is_refused(gl) -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='.5'/><geom size='.1'/></worldbody></mujoco>")
    plain = ball_surface("clay")
    mapped = Surface(plain.V, plain.F, plain.charts, heatmap_colors=COLORS)
    halo = np.zeros((6, plain.charts.page.block, plain.charts.page.block), np.float32)
    with Renderer(gl, model, {0: mapped}, size=(32, 24)) as renderer:
        renderer.set_heatmap(0, halo, 1.0)
        with pytest.raises(RippleError, match=r"shape \[6, 8, 8\]; valid is \[6, 10, 10\]"):
            renderer.set_heatmap(0, halo[:, 1:-1, 1:-1], 1.0)
        with pytest.raises(RippleError, match=r"limit is 0\.0"):
            renderer.set_heatmap(0, halo, 0.0)
        with pytest.raises(RippleError, match="geom 1 is no target; the targets' geoms are: 0"):
            renderer.set_heatmap(1, halo, 1.0)
    with Renderer(gl, model, {0: plain}, size=(32, 24)) as renderer, pytest.raises(RippleError, match="has no heatmap"):
        renderer.set_heatmap(0, halo, 1.0)
