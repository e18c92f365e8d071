"""Deferred shading: frame sizes, reflections of surfaces and floor, and transparency."""

import numpy as np
import pytest
from drawn import BALL, FLOOR, FRONT, SUN, ball_surface, frame_of, light_of, posed

from ripple_sim.render import Camera, Renderer, Surface
from ripple_sim.render.passes import TILE, touched_tiles
from ripple_sim.render.surfaces import Charts
from ripple_sim.solver import HeightMap, RippleError, sphere_atlas

XML = '<mujoco><worldbody><geom type="sphere" size="1" rgba=".8 .2 .2 1"/></worldbody></mujoco>'
CAMERA = Camera((0.0, 0.0, 0.0), 4.0, 90.0, 0.0, 45.0)
CLOSE = Camera((0.0, 0.0, 0.0), 4.0, 90.0, 0.0, 20.0)  # the ball fills the frame


def frame(gl, size, camera=CAMERA, **options):
    model, data = posed(XML)
    with Renderer(gl, model, {}, size=size, **options) as renderer:
        return renderer.render(data, {}, camera)


@pytest.mark.parametrize("size", [(0, 4), (4, 0), (-3, 5), (1_000_000, 4), (4, 1_000_000)])
def test_a_size_that_the_driver_cannot_draw_is_refused(gl, size):
    with pytest.raises(
        RippleError, match=rf"frame size must be 1 to \d+ .*, got {size[0]}x{size[1]}"
    ):
        frame(gl, size)


@pytest.mark.parametrize("samples", [0, 4])
def test_the_smallest_frames_are_drawn(gl, samples):
    got = frame(gl, (1, 3), CLOSE, samples=samples).astype(int)
    assert got.shape[:2] == (3, 1)
    assert got[1, 0, 0] > got[1, 0, 2] + 40


def test_samples_smooth_the_outline_and_leave_the_inside_as_it_is(gl):
    hard, smooth = (
        frame(gl, (24, 24), samples=samples, alpha=True).astype(int) for samples in (0, 4)
    )
    inside = np.s_[9:15, 9:15]
    assert np.abs(hard[inside] - smooth[inside]).max() <= 6
    assert set(np.unique(hard[..., 3])) == {0, 255}
    assert len(np.unique(smooth[..., 3])) > 2


def test_a_sharp_edge_of_polished_metal_is_no_brighter_than_its_sides(gl):
    xml = """<mujoco><asset><material name="metal" metallic="1" roughness="0.1" rgba=".7 .4 .2 1"/>
      <mesh name="prism" vertex="1 0 -1 -1 1 -1 -1 -1 -1 1 0 1 -1 1 1 -1 -1 1"/></asset><worldbody>
      <light type="directional" dir="-.5 0 -1"/>
      <geom type="mesh" mesh="prism" material="metal"/></worldbody></mujoco>"""
    model, data = posed(xml)
    with Renderer(gl, model, {}, size=(64, 64), samples=0) as renderer:
        column = renderer.render(data, {}, Camera((0.0, 0.0, 0.0), 6.0, 60.0, -40.0, 15.0))[
            8:56, 24, 0
        ].astype(int)
    edge = int(np.abs(np.diff(column)).argmax())
    above = column[edge - 5]
    beside = column[edge - 3 : edge + 5]
    below = column[edge + 6]
    assert above > below + 40
    assert below - 4 <= beside.min() <= beside.max() <= above + 4


@pytest.mark.parametrize(("look", "bound"), [("metal", 10.0), ("water", 4.0), ("rubber", 1.5)])
def test_ripples_finer_than_a_pixel_look_as_in_a_large_frame_that_is_shrunk(gl, look, bound):
    """Root mean square of the luminance's error, of 255, on the inner part of the ball."""
    atlas = sphere_atlas(0.5, 64)
    away = np.arccos(np.clip(atlas.positions @ [0.9, -0.9, 1.5], -1.0, 1.0)) / 2
    height_map = HeightMap(atlas.texels)(
        (0.0016 * np.cos(2 * np.pi * away / 0.04)).astype(np.float32)
    )
    surface = Surface(atlas.mesh.V, atlas.mesh.F, Charts.of(atlas), look)
    model, data = posed('<mujoco><worldbody><geom size=".5"/></worldbody></mujoco>')

    def luminance(size):
        with Renderer(gl, model, {0: surface}, size=(size, size), samples=0) as renderer:
            shown = renderer.render(
                data, {0: height_map}, Camera((0.0, 0.0, 0.0), 4.0, 90.0, -20.0, 15.0)
            )
        return (
            (shown @ [0.2126, 0.7152, 0.0722])
            .reshape(24, size // 24, 24, size // 24)
            .mean(axis=(1, 3))
        )

    x, y = np.meshgrid(*2 * [np.arange(24) - 11.5])
    error = (luminance(24) - luminance(96))[np.hypot(x, y) < 7]
    assert np.sqrt((error**2).mean()) < bound


def test_a_rough_surface_blurs_the_shadows_that_it_reflects(gl):
    """A metal wall shows less of a small plate's shadow if the metal is rough."""
    body = '<geom type="box" size="1 .1 .6" pos="0 .5 .6" material="m"/>'
    body += '<geom type="box" size=".15 .15 .01" pos="-.6 -.1 .75"/>' + FLOOR
    deepest = []
    for roughness in (0.1, 0.6):
        asset = f'<material name="m" rgba=".8 .8 .8 1" metallic="1" roughness="{roughness}"/>'
        seen = {"asset": asset, "camera": FRONT, "size": (320, 240)}
        with_shadow, without = (
            light_of(gl, body + SUN.format(1.0, flag), **seen) for flag in ("true", "false")
        )
        on_wall = np.s_[136:147, 140:200, 1]
        deepest.append((1.0 - with_shadow / without)[on_wall].max())
    assert deepest[1] < 0.355 * deepest[0]


def test_a_reflecting_floor_shows_the_ball_upside_down(gl):
    def frame(reflectance: float):
        asset = f'<material name="f" rgba=".4 .4 .4 1" reflectance="{reflectance}"/>'
        floor = '<geom type="plane" size="0 0 .1" material="f"/>'
        ball = BALL.replace(".8 .2 .2", "1 0 0")
        return frame_of(
            gl, floor + ball, asset=asset, camera=Camera((0, 0, 0), 4.0, 90.0, -20.0, 40.0)
        )

    redder = [(f[..., 0] - f[..., 2])[70:110, 70:90].max() for f in (frame(0.0), frame(0.5))]
    assert redder[1] > redder[0] + 40


def test_tiles_cover_the_boxes_once_and_little_more() -> None:
    boxes = np.array([[10, 20, 60, 50], [40, 40, 64, 64], [150, 100, 200, 120], [70, 70, 70, 70]])
    shown = np.zeros((120, 200), dtype=int)
    wanted = np.zeros((120, 200), dtype=bool)
    tiles = touched_tiles(boxes, (200, 120))
    for left, lower in TILE * tiles:
        shown[lower : lower + TILE, left : left + TILE] += 1
    for left, lower, right, upper in boxes:
        wanted[lower:upper, left:right] = True
    assert shown.max() == 1
    assert (shown[wanted] == 1).all()
    assert len(tiles) == 7
    assert not len(touched_tiles(boxes[:0], (200, 120)))


def test_a_transparent_geom_shows_the_objects_behind_it(gl):
    wall = '<geom type="box" size="3 .1 3" pos="0 2 0" rgba="0 0 1 1"/>'
    glass = '<geom type="box" size=".5 .02 .5" pos="0 0 .5" rgba="1 0 0 {}"/>'
    middle = np.s_[55:65, 75:85]
    panes = glass.format(1.0), glass.format(0.5), ""
    red, mixed, blue = (
        frame_of(gl, wall + pane, camera=FRONT)[middle].mean(axis=(0, 1)) for pane in panes
    )
    np.testing.assert_allclose(mixed, (red + blue) / 2, atol=12)


def test_a_transparent_plane_is_drawn_too(gl):
    pane = '<geom type="plane" size=".5 .5 .1" pos="0 0 .5" rgba="1 0 0 .5"/>'
    assert (frame_of(gl, FLOOR + pane) - frame_of(gl, FLOOR))[60, 80, 2] < -40


def test_water_shows_the_objects_behind_it_and_clay_does_not(gl):
    """A wall behind the ball tints the middle of the frame through a clear body alone."""

    def middle(look: str, rgba: str) -> np.ndarray:
        body = (
            f'<geom name="t" type="sphere" size="1"/><geom type="box" size="4 .1 4" pos="0 3 '
            f'0" '
            f'rgba="{rgba}"/>'
        )
        camera = Camera((0.0, 0.0, 0.0), 4.0, 90.0, 0.0, 40.0)
        frame = frame_of(
            gl, body, camera=camera, targets={"t": ball_surface(look, 1.0)}, size=(240, 180)
        )
        return frame[80:100, 110:130].mean(axis=(0, 1))

    for look, seen in (("water", True), ("clay", False)):
        change = middle(look, "0 0 1 1") - middle(look, "1 0 0 1")
        assert bool(change[2] > 30) is seen, (look, change)
