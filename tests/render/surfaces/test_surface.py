"""The surface of a target: colour, heatmap, both sides, and its mesh cut at charts."""

from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from drawn import ball_surface, posed
from hand_made import RIM, flat_charts
from sphere_height_maps import cube_charts
from triangles import areas, cross_products, directed_edges, place_numbers

from ripple_sim.render import LOOKS, Camera, Renderer, Surface
from ripple_sim.render.surfaces import (
    COORDINATES,
    NORMAL,
    POSITION,
    Charts,
    split_at_charts,
    target_color,
)
from ripple_sim.render.visuals import shapes
from ripple_sim.solver import HeightMap, RippleError, TexelMesh, texel_atlas
from ripple_sim.solver.layouts.cube import CHART_NORMALS

ROUND_OFF = 1e-9  # of coordinates of about 1

SHEET_RESOLUTION = 24
SHEET_CORNERS = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
SHEET_MODEL = """<mujoco><worldbody>
  <light directional="true" pos="0 0 3" dir=".4 .2 {}" diffuse=".8 .8 .8" castshadow="true"/>
  <geom name="sheet" type="sphere" size="1"/>
  <geom type="sphere" size=".2" pos=".3 .1 {}" rgba=".8 .2 .2 1"/>
</worldbody></mujoco>"""


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
def test_a_target_has_the_chosen_colour_or_the_models_or_the_looks(geom, given, shown):
    """A video once took the look's colour where a loop of one's own took the geom's."""
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><material name="green" rgba="0 .8 0 1"/>'
        '<texture name="t" type="2d" builtin="checker" width="8" height="8"/><material '
        'name="checked" texture="t"/>'
        f'</asset><worldbody><geom type="sphere" size="0.5" {geom}/></worldbody></mujoco>'
    )
    assert target_color(model, 0, "jelly", given) == pytest.approx(shown)


@dataclass
class ShownMesh:
    """Triangles, and what the vertices have.

    `same` has a number for each vertex, equal for vertices that stand for one point of the surface
    with one normal. `chart` is the chart of each vertex, once the mesh is cut.
    """

    F: np.ndarray
    attributes: np.ndarray
    same: np.ndarray
    chart: np.ndarray | None = None

    def corners(self) -> np.ndarray:
        """Attributes of the corners of all triangles [m, 3, ...]."""
        return self.attributes[self.F]


def cut_at_charts(mesh: ShownMesh) -> ShownMesh:
    charts = cube_charts(mesh.attributes[:, COORDINATES])
    return ShownMesh(*split_at_charts((mesh.F, mesh.attributes, mesh.same), charts))


def turned(points: np.ndarray, seed: int) -> np.ndarray:
    """Points under a random rotation, so that triangles cross the borders askew."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return points @ (q * np.linalg.det(q))


def ball_mesh(divisions: int, seed: int) -> ShownMesh:
    """A ball of radius 2; its chart coordinates are directions of vertices."""
    ball = shapes.ball(divisions)
    V = turned(ball.shell, seed)
    return ShownMesh(ball.faces, np.concatenate([2 * V, V, V], axis=1), np.arange(len(V)))


def faceted_mesh(seed: int) -> ShownMesh:
    """A ball with hard edges: vertices stand once for each normal there."""
    ball = ball_mesh(3, seed)
    corners = ball.corners()
    normals = cross_products(corners[:, :, POSITION])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    corners[:, :, NORMAL] = normals[:, None]
    flat = corners.reshape(-1, 9)
    _, first, number = np.unique(flat.round(12), axis=0, return_index=True, return_inverse=True)
    return ShownMesh(number.reshape(-1, 3), flat[first], np.arange(len(first)))


@pytest.fixture(params=["1 division", "2 divisions", "5 divisions", "9 divisions", "facets"])
def mesh(request) -> ShownMesh:
    if request.param == "facets":
        return faceted_mesh(seed=4)
    divisions = int(request.param.split()[0])
    return ball_mesh(divisions, seed={1: 0, 2: 1, 5: 2, 9: 3}[divisions])


@pytest.fixture
def cut(mesh: ShownMesh) -> ShownMesh:
    return cut_at_charts(mesh)


def test_no_gap_opens_and_no_area_is_lost(mesh, cut):
    assert len(cut.F) > len(mesh.F)
    before = areas(mesh.corners()[:, :, POSITION])
    after = areas(cut.corners()[:, :, POSITION])
    assert after.sum() == pytest.approx(before.sum(), rel=1e-10)  # round-off
    place = place_numbers(cut.attributes[:, POSITION])
    edges = directed_edges(place[cut.F])
    distinct, count = np.unique(edges, axis=0, return_counts=True)
    # each edge is there once in either direction
    assert count.max() == 1
    np.testing.assert_array_equal(distinct, np.unique(edges[:, ::-1], axis=0))


def test_every_cut_triangle_lies_in_one_chart_with_unit_normals(cut):
    chart = cut.chart[cut.F]
    corners = cut.corners()
    assert (chart == chart[:, :1]).all()
    # in its share of space the chart's own axis is the nearest of the six
    along_axes = np.einsum("fki,ci->fkc", corners[:, :, COORDINATES], CHART_NORMALS)
    along_own_axis = np.take_along_axis(along_axes, chart[:, :, None], axis=2)[..., 0]
    assert (along_own_axis >= along_axes.max(axis=2) - ROUND_OFF).all()
    assert set(np.unique(chart)) == set(range(6))
    facing = cross_products(corners[:, :, POSITION])
    middles = corners[:, :, POSITION].mean(axis=1)
    assert (np.einsum("fi,fi->f", facing, middles) > 0).all()
    lengths = np.linalg.norm(cut.attributes[:, NORMAL], axis=1)
    np.testing.assert_allclose(lengths, 1.0, atol=ROUND_OFF)
    assert (np.einsum("fi,fki->fk", facing, corners[:, :, NORMAL]) > 0).all()


def test_only_vertices_on_chart_borders_are_shared(cut):
    """Equal where position and normal are: a border is no crease, and a crease stays one."""
    number = place_numbers(cut.attributes[:, :6])  # position and normal
    pairs = np.unique(np.column_stack([number, cut.same]), axis=0)
    assert len(np.unique(pairs[:, 0])) == len(pairs) == len(np.unique(pairs[:, 1]))
    # once for each chart, no more
    with_chart = np.column_stack([cut.attributes, cut.chart])
    assert len(np.unique(with_chart, axis=0)) == len(cut.attributes)
    _, copies = np.unique(cut.same, return_counts=True)
    assert copies.max() == 3  # at the cube's corners


def test_texture_coordinates_keep_their_seam_across_a_border():
    """Two triangles share a side over an edge of the cube, at which a texture ends and begins."""
    places = 2 * np.array(
        [[1.0, 0.1, 0.5], [1.0, 0.1, -0.5], [0.5, -0.6, 1.0], [0.5, 0.8, 1.0], [0.5, 0.1, 1.0]]
    )
    V = places[[0, 4, 2, 0, 4, 3]]
    normal = np.tile([0.8, 0.0, 0.6], (6, 1))
    u = np.array([1.0, 1.0, 0.7, 0.0, 0.0, 0.3])
    U = 9  # its column
    F = np.array([[0, 2, 1], [3, 4, 5]])
    same = np.array([0, 1, 2, 0, 1, 3])
    cut = cut_at_charts(ShownMesh(F, np.column_stack([V, normal, V, u]), same))
    assert len(np.unique(cut.chart)) == 2
    values = cut.corners()[:, :, U]
    in_first = (values >= 0.7 - ROUND_OFF).all(axis=1)
    in_second = (values <= 0.3 + ROUND_OFF).all(axis=1)
    assert (in_first | in_second).all()
    x, y, z = cut.attributes[:, POSITION].T
    on_seam_and_border = (np.abs(y - 0.2) < ROUND_OFF) & (np.abs(x - z) < ROUND_OFF)
    assert sorted(cut.attributes[on_seam_and_border, U].round(9)) == [0.0, 0.0, 1.0, 1.0]
    assert len(np.unique(cut.same[on_seam_and_border])) == 1


def test_a_long_triangle_over_a_corner_of_the_cube_has_a_part_in_each_chart_there():
    corners = np.array([[1.0, 0.1, 0.1], [0.1, 1.0, 0.1], [0.1, 0.1, 1.0]])
    normal = np.ones((3, 3)) / np.sqrt(3)
    directions = corners / np.linalg.norm(corners, axis=1, keepdims=True)
    attributes = np.concatenate([corners, normal, directions], axis=1)
    cut = cut_at_charts(ShownMesh(np.array([[0, 1, 2]]), attributes, np.arange(3)))
    assert len(np.unique(cut.chart)) == 3
    part_areas = areas(cut.corners()[:, :, POSITION])
    part_charts = cut.chart[cut.F[:, 0]]
    (whole_area,) = areas(corners[None])
    for chart in np.unique(cut.chart):
        assert part_areas[part_charts == chart].sum() == pytest.approx(whole_area / 3)
    from_middle = np.linalg.norm(cut.attributes[:, POSITION] - corners.mean(axis=0), axis=1)
    middle = from_middle < ROUND_OFF
    assert middle.sum() == 3
    assert len(np.unique(cut.same[middle])) == 1


def test_invalid_heatmaps_are_refused(gl) -> None:
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom size='.5'/><geom size='.1'/></worldbody></mujoco>"
    )
    plain = ball_surface("clay")
    colors = np.arange(9, dtype=np.uint8).reshape(3, 3)
    mapped = Surface(plain.V, plain.F, plain.charts, heatmap_colors=colors)
    halo = np.zeros((6, plain.charts.page.block, plain.charts.page.block), np.float32)
    with Renderer(gl, model, {0: mapped}, size=(32, 24)) as renderer:
        renderer.set_heatmap(0, halo, 1.0)
        with pytest.raises(RippleError, match=r"shape \[6, 10, 10\] .*, got \[6, 8, 8\]"):
            renderer.set_heatmap(0, halo[:, 1:-1, 1:-1], 1.0)
        with pytest.raises(RippleError, match=r"limit must be .*, got 0\.0"):
            renderer.set_heatmap(0, halo, 0.0)
        with pytest.raises(RippleError, match="geom 1 is no target; the targets' geoms are: 0"):
            renderer.set_heatmap(1, halo, 1.0)
    with (
        Renderer(gl, model, {0: plain}, size=(32, 24)) as renderer,
        pytest.raises(RippleError, match="has no heatmap"),
    ):
        renderer.set_heatmap(0, halo, 1.0)


def sheet(turned: bool) -> TexelMesh:
    """A square that faces up, or the same turned to face down."""
    corners = SHEET_CORNERS[[0, 3, 2, 1]] if turned else SHEET_CORNERS
    return flat_charts([corners], [[RIM] * 4], SHEET_RESOLUTION)


def picture(gl, turned: bool, above: bool) -> np.ndarray:
    """Frame of a bump, with lamp, ball and camera above or below the sheet."""
    side = 1 if above else -1
    model, data = posed(SHEET_MODEL.format(-side, 0.6 * side))
    texels = sheet(turned)
    x, y, _ = np.moveaxis(texels.positions, -1, 0)
    bump = 0.2 * np.exp(-((x + 0.3) ** 2 + y**2) / 0.1)
    height = (-bump if turned else bump).astype(np.float32)
    atlas = texel_atlas(texels)
    surface = Surface(atlas.mesh.V, atlas.mesh.F, Charts.of(atlas), "rubber")
    camera = Camera((0.0, 0.0, 0.0), 4.0, 90.0, -50.0 * side, 40.0)
    with Renderer(gl, model, {0: surface}, size=(160, 120), samples=4) as renderer:
        return renderer.render(data, {0: HeightMap(texels)(height)}, camera).astype(int)


def test_a_sheet_looks_the_same_whichever_way_its_triangles_are_wound(gl):
    """From above and from below: shape, light, shadow of the ball and ambient occlusion."""
    for above in (True, False):
        plain = picture(gl, turned=False, above=above)
        turned = picture(gl, turned=True, above=above)
        difference = np.abs(plain - turned)  # [codes of 255]
        assert np.ptp(plain[40:80, 50:110]) > 60  # the bump and the shadow show
        # rays of ambient occlusion and triangles at silhouettes differ
        assert difference.mean() < 0.5
        assert (difference.max(axis=2) > 12).mean() < 0.002
