"""Shadows: in place, lighter for transparent geoms, and none hides another."""

import moderngl
import numpy as np
import pytest
from drawn import BALL, FLOOR, FRONT, SIZE, SPOT, SUN, ball_surface, frame_of, light_of
from scipy.ndimage import binary_erosion, distance_transform_edt

from ripple_sim.render import srgb_to_linear
from ripple_sim.render.passes import ShadowMaps
from ripple_sim.render.visuals import Light

SLAB = '<geom type="box" size="3 3 .1" pos="0 0 -.1" rgba=".8 .8 .8 1"/>'
METRE = SIZE[1] / (2 * 4.0 * np.tan(np.radians(20)))  # of the floor, seen from above [pixels]


def test_every_light_with_castshadow_casts_its_shadow_where_geometry_says(gl):
    """Each of four suns, from four sides, darkens the floor where the ball stands in its way."""
    sun = (
        '<light directional="true" pos="0 0 3" dir="{} {} -1" diffuse=".2 .2 .2" castshadow="{}"/>'
    )
    ways = [(1, 0), (-1, 0), (0, 1), (0, -1)]
    plain = frame_of(gl, FLOOR + BALL + "".join(sun.format(*way, "false") for way in ways))
    shaded = frame_of(gl, FLOOR + BALL + "".join(sun.format(*way, "true") for way in ways))
    for x, y in ways:  # the ball's middle, 0.8 m up, casts its shadow 0.8 m away
        column = int(SIZE[0] / 2 + 0.8 * x * METRE)
        row = int(SIZE[1] / 2 - 0.8 * y * METRE)
        here = np.s_[row - 2 : row + 2, column - 2 : column + 2]
        assert shaded[here].mean() < plain[here].mean() - 6
    beside = np.s_[:8, :8]
    assert abs(shaded[beside].mean() - plain[beside].mean()) < 1


def test_more_lights_than_can_cast_shadows_shine_all_the_same(gl):
    suns = "".join(
        SUN.format(x, "true").replace(".8 .8 .8", ".1 .1 .1") for x in np.linspace(-1, 1, 6)
    )
    assert (
        frame_of(gl, FLOOR + BALL + suns)[:8].mean()
        > frame_of(gl, FLOOR + BALL, lighting="model")[:8].mean() + 20
    )


def test_a_near_light_and_a_sun_cast_shadows_side_by_side(gl):
    """Lamp at x = -1, 2 m up: a ball's centre at 0.8 m throws its shadow to x = 0.67."""
    sun = SUN.format(-1.0, "{}").replace(".8 .8 .8", ".4 .4 .4")
    spot = SPOT.format(-1.0, 0.5).replace("/>", ' castshadow="{}"/>')
    places = [int(SIZE[0] / 2 + x * METRE) for x in (-0.8, 0.75)]
    frames = (
        frame_of(gl, FLOOR + BALL + sun.format(casts) + spot.format(casts))
        for casts in ("false", "true")
    )
    plain, shaded = (
        np.array([frame[56:64, x - 3 : x + 3].mean() for x in places]) for frame in frames
    )
    assert (shaded < plain - 6).all()


@pytest.mark.parametrize("below", [FLOOR, SLAB], ids=["floor", "solid"])
def test_a_penumbra_is_as_wide_as_the_light_and_the_height_make_it(gl, below):
    """A sun of tangent 0.05 at 45 degrees over the edge of a plate 1.4 m up.

    The edge lies 2 m above the floor along a ray. A solid casts a shadow too: it lies in the shadow
    map itself. Plate and floor are dark, so that the tone curve is straight.
    """
    plate = '<geom type="box" size=".5 .5 .01" pos="-1.4 0 1.4"/>'
    size = (640, 480)
    body = below.replace(".8 .8 .8", ".3 .3 .3") + plate + SUN
    shaded, plain = (
        light_of(gl, body.format(1.0, casts), size=size) for casts in ("true", "false")
    )
    # from beyond the shadow to its middle
    taken = (plain - shaded)[: size[1] // 2, size[0] // 2, 1]
    share = 1 - taken / taken[-size[1] // 20 :].mean()
    width = (np.argmax(share < 0.1) - np.argmax(share < 0.9)) / (METRE * size[1] / SIZE[1])
    # of a disc's light, 0.9 and 0.1 pass at 0.69 of its radius
    assert width == pytest.approx(2 * 0.69 * 0.05 * np.hypot(1.4, 1.4), rel=0.12)


def test_penumbras_have_neither_noise_nor_hatching(gl):
    """Along the edge of a plate all pixels of a penumbra are alike."""
    plate = '<geom type="box" size=".9 .5 .01" pos="-1.4 0 1.4"/>'
    frame = frame_of(gl, FLOOR + plate + SUN.format(1.0, "true"), size=(320, 240))
    edge = frame[40:120, 140:180, 1]
    assert np.ptp(edge.mean(axis=1)) > 60
    assert edge.std(axis=1).max() < 1.5


@pytest.mark.parametrize("below", [FLOOR, SLAB], ids=["floor", "solid"])
def test_shadows_have_the_resolution_of_the_frame(gl, below):
    """Across a shadow's edge, brightness changes evenly from pixel to pixel."""
    plate = '<geom type="box" size=".9 .5 .01" pos="-1.4 0 1.4"/>'
    rows = frame_of(gl, below + plate + SUN.format(1.0, "true"), size=(320, 240))[
        40:120, 150:170, 1
    ].mean(axis=1)
    steps = np.abs(np.diff(rows))
    assert steps[::2].sum() == pytest.approx(steps[1::2].sum(), rel=0.2)


def test_a_wide_penumbra_has_no_steps(gl):
    """Brightness across a ball's soft shadow bends little over any eight pixels."""
    floor = frame_of(gl, FLOOR + BALL, size=(640, 480))[160:320, 400:570].mean(axis=2)
    for each in (floor, floor.T):
        assert np.abs(each[8:] - 2 * each[4:-4] + each[:-8]).max() < 9


def test_the_edges_of_a_coarse_ball_do_not_shade_it(gl):
    """A small picture, whose ball has few triangles, looks as a large one does."""
    scene = FLOOR + BALL + SUN.format(1.0, "true")
    small = frame_of(gl, scene, camera=FRONT)
    large = frame_of(gl, scene, camera=FRONT, size=(4 * SIZE[0], 4 * SIZE[1]))
    large = large.reshape(SIZE[1], 4, SIZE[0], 4, 3).mean(axis=(1, 3))
    ball = binary_erosion(large[..., 0] - large[..., 2] > 60, iterations=2)
    assert np.abs(small - large)[ball].max() < 20


def test_shadows_on_translucent_things_are_softer(gl):
    """A ball's shadow on a ball of skin: its edge is wider than on clay."""
    body = '<geom name="b" type="sphere" size=".5" pos="0 0 .5" rgba=".5 .5 .5 1"/>'
    body += '<geom size=".1" pos="-.5 0 1.5"/>' + FLOOR + SUN.format(1.0, "{}")
    steepest = {}
    for look in ("clay", "skin"):
        seen = {"targets": {"b": ball_surface(look)}, "size": (320, 240)}
        shaded, plain = (light_of(gl, body.format(flag), **seen) for flag in ("true", "false"))
        lit = (shaded / plain)[118:122, 140:155].mean(axis=0)  # beside the lamp's highlight
        # relative to the whole range, since other lamps light it too
        steepest[look] = np.abs(np.diff(lit, axis=0)).max(axis=0) / np.ptp(lit, axis=0)
    assert steepest["skin"][0] < 0.85 * steepest["clay"][0]


def test_a_shadow_on_the_floor_has_the_size_that_geometry_gives_it(gl):
    """At 45 degrees in a wide scene with coarse maps, half of the light is below the edge."""
    plate = '<geom type="box" size=".5 .5 .01" pos="-1.4 0 1.4"/>'
    far = "".join(f'<geom type="sphere" size=".1" pos="0 {y} .1"/>' for y in (-9, 9))
    size = (320, 240)
    frame = light_of(gl, FLOOR + plate + far + SUN.format(1.0, "true"), size=size)
    along = frame[size[1] // 2, size[0] // 2 :, 1]  # to the right of the shadow's middle
    share = (along - along[0]) / (along[-20:].mean() - along[0])
    edge = np.interp(0.5, share[:100], np.arange(100) + 0.5) / (METRE * size[1] / SIZE[1])
    assert edge == pytest.approx(0.5 + 0.01, abs=0.015)


def test_blockers_are_means_over_all_texels_of_the_shadow_map(gl, resources, frame):
    """Coverage, and its first two moments of the distance from the light, to the coarsest level."""
    sun = Light(np.array([0.0, 0.0, 1.0]), np.ones(3), None, 0.02, np.pi, shadow=True)
    maps = ShadowMaps(resources, 1, 360)
    maps.fit(frame, [sun], np.zeros(3), 1.0)
    frame.bind()
    rng = np.random.default_rng(5)
    depth = np.where(
        rng.random((maps.size, maps.size)) < 0.6, rng.random((maps.size, maps.size)), 1.0
    ).astype("f4")
    with gl as ctx:
        maps._depth.write(depth)
        # what was drawn before may have left blending on, and a new texture may hold anything
        maps._blockers.write(np.ones((maps.size // 4, maps.size // 4, 4), "f4"))
        ctx.enable(moderngl.BLEND)
        ctx.blend_func = moderngl.ONE, moderngl.ONE
        maps.find_blockers(ctx)
        levels = [np.frombuffer(maps._blockers.read(level=level), "f4") for level in (0, 3)]
    away = depth * frame.values["shadows"][0]["depth"][0]
    exact = (depth < 1.0)[..., None] * np.stack([np.ones_like(away), away, away**2], axis=-1)
    for level, texels in zip(levels, (4, 32), strict=True):
        side = maps.size // texels
        means = exact.reshape(side, texels, side, texels, 3).mean(axis=(1, 3))
        np.testing.assert_allclose(level.reshape(side, side, 4)[..., :3], means, rtol=1e-4)


DARK_FLOOR = FLOOR.replace(".8 .8 .8", ".6 .6 .6")  # below the shoulder of the tone mapping
PLATE = '<geom type="box" size=".3 .3 .01" pos="-1 0 1" rgba=".5 .5 .5 {}"/>'


def floor_at(frame, x, y=0.0, half=2):
    """Linear light of the floor about a point [m], [2 half, 2 half, 3]."""
    column = int(SIZE[0] / 2 + x * METRE)
    row = int(SIZE[1] / 2 - y * METRE)
    return srgb_to_linear(frame[row - half : row + half, column - half : column + half] / 255)


@pytest.mark.parametrize("opacity", [0.2, 0.5, 0.8])
def test_a_transparent_geom_blocks_light_in_proportion_to_its_opacity(gl, opacity):
    """A plate 1 m up throws its shadow 1 m to the right."""
    shaded, full = (
        frame_of(gl, DARK_FLOOR + PLATE.format(each) + SUN.format(1.0, "true"))
        for each in (opacity, 1.0)
    )
    plain = frame_of(gl, DARK_FLOOR + PLATE.format(1.0) + SUN.format(1.0, "false"))
    open_floor, under, dark = (floor_at(frame, 0.0) for frame in (plain, shaded, full))
    share = (open_floor - under).mean() / (open_floor - dark).mean()
    assert share == pytest.approx(opacity, abs=0.05)
    assert np.ptp(under, axis=(0, 1)).max() < 0.02  # no pattern


def test_a_body_under_glass_keeps_its_shadow(gl):
    """A plate under a pane has the shadow it has without the pane; the pane's is lighter."""
    body = (
        DARK_FLOOR
        + '<geom type="box" size=".1 .3 .01" pos="-.2 0 .4" rgba=".5 .5 .5 1"/>'
        + SUN.format(1.0, "true")
    )
    bare, covered = (frame_of(gl, body + pane) for pane in ("", PLATE.format(0.4)))
    np.testing.assert_allclose(
        floor_at(covered, 0.2, half=1), floor_at(bare, 0.2, half=1), atol=0.02
    )


def test_water_is_a_lens(gl):
    """Its shadow is dark towards the rim; the light in the middle has its colour."""
    body = (
        '<geom name="b" type="sphere" size=".5" pos="-1 0 1"/>' + DARK_FLOOR + SUN.format(1.0, "{}")
    )
    kinds = ("false", "clay"), ("true", "water"), ("true", "clay")
    plain, water, clay = (
        frame_of(gl, body.format(flag), targets={"b": ball_surface(look)}) for flag, look in kinds
    )
    open_floor, middle, dark = (floor_at(frame, 0.0) for frame in (plain, water, clay))
    rim = floor_at(water, 0.0, 0.4)
    assert (rim - dark).max() < 0.3 * (open_floor - dark).max()
    assert (middle[..., 1] - dark[..., 1]).min() > 0.5 * (open_floor - dark).max()
    assert middle[..., 0].mean() < 0.7 * middle[..., 2].mean()


def test_no_light_is_lost_beside_a_penumbra(gl):
    """Pixels that lose a little light lie within a few pixels of pixels in clear shadow."""
    box = '<geom type="box" size=".5 .5 .5" pos="-.5 .2 .5" euler="0 0 40" rgba=".9 .1 .2 .4"/>'
    body = DARK_FLOOR + box + SUN
    size = (320, 240)
    shaded, plain = (frame_of(gl, body.format(1.0, flag), size=size) for flag in ("true", "false"))
    taken = (plain - shaded).max(axis=2)
    assert distance_transform_edt(taken < 5)[taken >= 2].max() < 6


def test_a_wide_penumbra_has_no_pattern_where_blocks_of_the_floor_are_interpolated(gl):
    body = '<geom name="b" type="sphere" size=".5" pos="0 0 1.5"/>' + DARK_FLOOR
    frame = frame_of(
        gl, body, targets={"b": ball_surface("water")}, lighting="studio", size=(1280, 960)
    )
    across = frame[480, 920:1240, 1]
    assert np.ptp(across) > 50
    assert np.abs(np.diff(across, 2)).max() <= 2
