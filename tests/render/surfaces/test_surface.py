"""The surface of a target: colour, heatmap, both sides, and its mesh cut at charts."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from drawn import ball_surface, posed
from hand_made import RIM, flat_charts
from sphere_height_maps import cube_charts

from ripple_sim.render import LOOKS, Camera, Renderer, Surface
from ripple_sim.render.surfaces import Charts, split_at_charts, target_color
from ripple_sim.render.visuals import shapes
from ripple_sim.solver import HeightMap, RippleError, TexelMesh, texel_atlas
from ripple_sim.solver.layouts.cube import CHART_NORMALS


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


def cut_at_charts(mesh, charts) -> SimpleNamespace:
    parts = split_at_charts(mesh, charts)
    return SimpleNamespace(**dict(zip(("F", "attributes", "same", "chart"), parts, strict=True)))


def turned(points: np.ndarray, seed: int) -> np.ndarray:
    """Points under a random rotation, so that triangles cross the borders askew."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return points @ (q * np.linalg.det(q))


def ball_mesh(divisions: int, seed: int):
    """F, attributes and same of a ball; its chart coordinates are directions of vertices."""
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
    return (
        np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        / 2
    )


MESHES = {f"ball {d} {s}": ball_mesh(d, s) for d, s in ((1, 0), (2, 1), (5, 2), (9, 3))} | {
    "facets": facets(4)
}


@pytest.fixture(params=MESHES)
def pair(request):
    """F and attributes of a mesh, and the mesh cut."""
    F, attributes, same = MESHES[request.param]
    return F, attributes, cut_at_charts((F, attributes, same), cube_charts(attributes[:, 6:]))


def test_no_gap_opens_and_no_area_is_lost(pair):
    F, attributes, cut = pair
    assert len(cut.F) > len(F)
    before = areas(attributes[F][:, :, :3])
    after = areas(cut.attributes[cut.F][:, :, :3])
    assert after.sum() == pytest.approx(before.sum(), rel=1e-10)
    _, place = np.unique(cut.attributes[:, :3].round(9), axis=0, return_inverse=True)
    # by numbers that are the same where positions are, but for round-off
    closed = place.ravel()[cut.F]
    sides = np.concatenate([closed[:, [0, 1]], closed[:, [1, 2]], closed[:, [2, 0]]])
    directed, count = np.unique(sides, axis=0, return_counts=True)
    assert count.max() == 1
    np.testing.assert_array_equal(directed, np.unique(sides[:, ::-1], axis=0))


def test_every_cut_triangle_lies_in_one_chart_with_unit_normals(pair):
    _, _, cut = pair
    chart = cut.chart[cut.F]
    corners = cut.attributes[cut.F]
    assert (chart == chart[:, :1]).all()
    # in its share of space the chart's own axis is the nearest of the six
    along = np.einsum("fki,ci->fkc", corners[:, :, 6:], CHART_NORMALS)
    own = np.take_along_axis(along, chart[:, :, None], axis=2)[..., 0]
    assert (own >= along.max(axis=2) - 1e-9).all()
    assert set(np.unique(chart)) == set(range(6))
    cross = np.cross(corners[:, 1, :3] - corners[:, 0, :3], corners[:, 2, :3] - corners[:, 0, :3])
    assert (np.einsum("fi,fi->f", cross, corners[:, :, :3].mean(axis=1)) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(cut.attributes[:, 3:6], axis=1), 1.0, atol=1e-9)
    assert (np.einsum("fi,fki->fk", cross, corners[:, :, 3:6]) > 0).all()


def test_only_vertices_on_chart_borders_are_shared(pair):
    """Equal where position and normal are: a border is no crease, and a crease stays one."""
    _, _, cut = pair
    _, by_value = np.unique(cut.attributes[:, :6].round(9), axis=0, return_inverse=True)
    pairs = np.unique(np.column_stack([by_value.ravel(), cut.same]), axis=0)
    assert len(np.unique(pairs[:, 0])) == len(pairs) == len(np.unique(pairs[:, 1]))
    # once for each chart, no more
    assert len(np.unique(np.column_stack([cut.attributes, cut.chart]), axis=0)) == len(
        cut.attributes
    )
    assert np.unique(cut.same, return_counts=True)[1].max() == 3  # at the cube's corners


def test_texture_coordinates_keep_their_seam_across_a_border():
    """Two triangles share a side over an edge of the cube, at which a texture ends and begins."""
    V = np.array(
        [[1.0, 0.1, 0.5], [1.0, 0.1, -0.5], [0.5, -0.6, 1.0], [0.5, 0.8, 1.0], [0.5, 0.1, 1.0]]
    )
    V = V[[0, 4, 2, 0, 4, 3]] * 2
    normal = np.tile([0.8, 0.0, 0.6], (6, 1))
    u = np.array([1.0, 1.0, 0.7, 0.0, 0.0, 0.3])
    attributes = np.column_stack([V, normal, V, u])
    mesh = np.array([[0, 2, 1], [3, 4, 5]]), attributes, np.array([0, 1, 2, 0, 1, 3])
    cut = cut_at_charts(mesh, cube_charts(attributes[:, 6:9]))
    assert len(np.unique(cut.chart)) == 2
    values = cut.attributes[cut.F][:, :, 9]
    assert ((values >= 0.7 - 1e-9).all(axis=1) | (values <= 0.3 + 1e-9).all(axis=1)).all()
    on_seam = (np.abs(cut.attributes[:, 1] - 0.2) < 1e-9) & (
        np.abs(cut.attributes[:, 0] - cut.attributes[:, 2]) < 1e-9
    )
    assert sorted(cut.attributes[on_seam, 9].round(9)) == [0.0, 0.0, 1.0, 1.0]
    assert len(np.unique(cut.same[on_seam])) == 1


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


COLORS = np.arange(9, dtype=np.uint8).reshape(3, 3)


def test_invalid_heatmaps_are_refused(gl) -> None:
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom size='.5'/><geom size='.1'/></worldbody></mujoco>"
    )
    plain = ball_surface("clay")
    mapped = Surface(plain.V, plain.F, plain.charts, heatmap_colors=COLORS)
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


N = 24
CORNERS = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
MODEL = """<mujoco><worldbody>
  <light directional="true" pos="0 0 3" dir=".4 .2 {}" diffuse=".8 .8 .8" castshadow="true"/>
  <geom name="sheet" type="sphere" size="1"/>
  <geom type="sphere" size=".2" pos=".3 .1 {}" rgba=".8 .2 .2 1"/>
</worldbody></mujoco>"""


def sheet(turned: bool) -> TexelMesh:
    """A square that faces up, or the same turned to face down."""
    return flat_charts([CORNERS[[0, 3, 2, 1]] if turned else CORNERS], [[RIM] * 4], N)


def picture(gl, turned: bool, above: bool) -> np.ndarray:
    """Frame of a bump, with lamp, ball and camera above or below the sheet."""
    side = 1 if above else -1
    model, data = posed(MODEL.format(-side, 0.6 * side))
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
        one, turned = (picture(gl, each, above) for each in (False, True))
        assert np.ptp(one[40:80, 50:110]) > 60  # the bump and the shadow show
        assert np.abs(one - turned).mean() < 0.5
        assert (np.abs(one - turned).max(axis=2) > 12).mean() < 0.002
