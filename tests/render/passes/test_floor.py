"""Floor and background: texture, edges, alpha, occlusion of the sky, coarse pixels."""

import tracemalloc
from unittest.mock import MagicMock

import mujoco
import numpy as np
import pytest
from drawn import BALL, FLOOR, FRONT, SIZE, SUN, frame_of, light_of
from scipy.ndimage import binary_erosion

from ripple_sim.render import Camera
from ripple_sim.render.passes import deferred
from ripple_sim.render.passes.floor import Floor, find_floor
from ripple_sim.render.visuals import Assets

CHECKER = """<texture name="c" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0" width="{0}"
  height="{0}"/>
<material name="c" texture="c" {1}/>"""


def test_the_floor_is_the_highest_of_the_planes_that_face_up_most() -> None:
    places = 'pos="0 0 -1"', "", 'pos="0 0 9" euler="90 0 0"', 'pos="0 0 9" euler="180 0 0"'
    low, high, wall, ceiling = (f'<geom type="plane" size="0 0 1" {place}/>' for place in places)
    for planes, floor in (
        (low + wall + high + ceiling, 2),
        (high + low, 0),
        (ceiling + wall, None),
        ("", None),
    ):
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{planes}</worldbody></mujoco>")
        assert find_floor(model, []) == floor


def test_a_plane_stays_the_floor_under_bodies_that_wait_far_above_it() -> None:
    waiting = '<body pos="0 0 120"><freejoint/><geom size=".06"/></body>'
    plane = '<geom type="plane" size="12 12 .1"/>'
    ball = '<geom size=".5" pos="0 0 .5"/>'
    scene = f"<mujoco><worldbody>{plane}{ball}{waiting}</worldbody></mujoco>"
    assert find_floor(mujoco.MjModel.from_xml_string(scene), []) == 0


def test_a_small_plane_is_no_floor() -> None:
    """An infinite plane is the floor before a large one, an opaque one before water; no wall is."""
    ground = '<geom type="plane" size="0 0 1"/>'
    large = '<geom type="plane" size="9 9 1" pos="0 0 .1"/>'
    table = '<geom type="plane" size=".8 .6 1" pos="0 0 .5"/>'
    ball = '<geom size=".3" pos="0 0 .8"/>'
    water = '<geom type="plane" size="0 0 1" pos="0 0 .2" rgba="0 0 1 .4"/>'
    wall = '<geom type="plane" size="0 0 1" zaxis="1 0 0"/>'
    for body, floor in (
        (table + ball, None),
        (table + ball + wall, None),
        (table + ground + ball, 1),
        (table + large + ball, 1),
        (ground + large + ball, 0),
        (water + ground + ball, 1),
        (water + ball, 0),
    ):
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
        assert find_floor(model, []) == floor


def test_a_table_casts_a_shadow_on_the_floor_and_gives_the_sky_no_colour(gl):
    table = '<geom type="plane" size=".5 .5 1" pos="0 0 1" rgba="{} 1"/>'
    red, blue = (
        frame_of(gl, FLOOR + table.format(rgb) + SUN.format(0.7, "true"), camera=FRONT).astype(int)
        for rgb in ("1 0 0", "0 0 1")
    )
    bare = frame_of(gl, FLOOR + SUN.format(0.7, "true"), camera=FRONT).astype(int)
    np.testing.assert_array_equal(red[:4], blue[:4])
    darker = (bare - red).min(axis=2) > 20
    assert darker.sum() > 200


def test_floor_texture_repeats_as_in_mujoco(gl):
    """A repetition of a 2 x 2 checker is 2 m wide and begins at -1 m: squares of 1 m."""
    asset = CHECKER.format(64, 'texuniform="true"')
    frame = frame_of(gl, '<geom type="plane" size="0 0 .1" material="c"/>', asset=asset)
    pixels = int(0.5 * SIZE[1] / (2 * 4.0 * np.tan(np.radians(20))))  # half a square
    y = SIZE[1] // 2
    x = SIZE[0] // 2
    quarters = np.array(
        [[frame[y + b * pixels, x + a * pixels].mean() for a in (-1, 1)] for b in (-1, 1)]
    )
    assert max(abs(quarters[0, 0] - quarters[1, 1]), abs(quarters[0, 1] - quarters[1, 0])) < 15
    assert abs(quarters[0, 0] - quarters[0, 1]) > 100


def test_the_edges_of_a_finite_floor_are_smooth(gl):
    """A white square in front of black: along its slanted edges lie pixels of all shades."""
    floor = '<geom type="plane" size=".5 .5 .1" euler="0 0 20" rgba="1 1 1 1"/>'
    sky = '<texture type="skybox" builtin="flat" rgb1="0 0 0" rgb2="0 0 0" width="16" height="96"/>'
    frame = frame_of(gl, floor + SUN.format(0.0, "false"), asset=sky)[..., 0]
    white = frame[60, 80]
    edge = (frame > 0.2 * white) & (frame < 0.8 * white)
    assert 40 < edge.sum() < 200
    shares = np.histogram(frame[edge] / white, bins=3, range=(0.2, 0.8))[0]
    assert shares.min() > 8


def test_alpha_leaves_the_geoms_and_their_shadows(gl):
    whole = frame_of(gl, FLOOR + BALL + SUN.format(0.5, "true"), camera=FRONT)
    frame = frame_of(gl, FLOOR + BALL + SUN.format(0.5, "true"), camera=FRONT, alpha=True)
    assert frame.shape == (SIZE[1], SIZE[0], 4)
    assert frame[0, 0, 3] == 0
    ball = binary_erosion(np.abs(whole[..., 0] - whole[..., 2]) > 60, iterations=2)
    assert ball.sum() > 200
    assert (frame[ball][:, 3] == 255).all()
    np.testing.assert_allclose(frame[ball][:, :3], whole[ball], atol=1)
    shadow = (np.abs(frame[..., :3]).max(axis=2) == 0) & (frame[..., 3] > 100)
    assert shadow.sum() > 50


def test_alpha_leaves_no_texture_of_the_floor(gl):
    floor = '<geom type="plane" size="0 0 .1" material="c"/>'
    assert not frame_of(gl, floor, asset=CHECKER.format(64, ""), alpha=True).any()


def test_sites_hide_no_sky(gl):
    """Under a wide site the floor stays as light as without it where no lamp shines."""
    roof = '<site type="box" size=".5 .5 .02" pos="0 0 .4" rgba="1 0 0 1"/>'
    light = {
        "visual": '<headlight ambient=".5 .5 .5" diffuse="0 0 0"/>',
        "lighting": "model",
        "camera": FRONT,
    }
    frames = [
        frame_of(gl, FLOOR + body, **light) for body in (roof, roof.replace("site", "geom"), "")
    ]
    under = np.s_[78:82, 75:85]
    site, geom, none = (frame[under].mean() for frame in frames)
    assert abs(site - none) < 1
    assert geom < none - 10


def test_a_ceiling_has_the_colour_and_the_light_of_the_floor_below(gl):
    """A white plate over a red sunlit floor, seen from below, is red."""
    floor = '<geom type="plane" size="0 0 .1" rgba=".9 .2 .2 1"/>'
    plate = '<geom type="box" size=".2 .2 .01" pos="0 0 .6" rgba="1 1 1 1"/>'
    sun = SUN.format(1.0, "true")
    light = {"visual": '<headlight active="0"/>', "lighting": "model"}
    below = Camera((0.0, 0.0, 0.45), 1.2, 90.0, 12.0, 40.0)
    frame = light_of(gl, floor + plate + sun, camera=below, **light)
    ceiling = frame[52:60, 70:90].mean(axis=(0, 1))
    ground = frame[-4:].mean(axis=(0, 1))
    assert ceiling[0] > 8 * ceiling[1]
    assert 0.5 * ground[0] < ceiling[0] < ground[0]


def test_a_ball_throws_its_colour_on_the_floor_most_where_it_is_lit(gl):
    """A red ball reddens the floor at its foot, a black ball does not; sun from the left."""
    floor = FLOOR.replace(".8 .8 .8", ".6 .6 .6")
    ball = '<geom type="sphere" size=".3" pos="0 0 .3" rgba="{} 1"/>'
    metre = SIZE[1] / (2 * 4.0 * np.tan(np.radians(20)))
    redder = {}
    for rgba in (".9 .1 .1", ".1 .1 .1"):
        frame = light_of(gl, floor + ball.format(rgba) + SUN.format(1.0, "true"), lighting="model")
        red, green, _ = np.moveaxis(frame[58:62], -1, 0)
        for x in (-0.36, 0.36, -1.2):
            column = int(SIZE[0] / 2 + x * metre)
            redder[rgba, x] = (red - green)[:, column - 1 : column + 1].mean()
    assert redder[".9 .1 .1", -0.36] > 0.02
    assert 0.01 < redder[".9 .1 .1", 0.36] < redder[".9 .1 .1", -0.36]
    assert redder[".9 .1 .1", -1.2] == pytest.approx(0.0, abs=0.003)
    assert max(redder[".1 .1 .1", x] for x in (-0.36, 0.36)) < 0.002


LAMPS = {
    "sun": '<light directional="true" dir="-.3 .4 -1"/>',
    "spot": '<light pos="1 -1 2" dir="-.5 .5 -1" cutoff="25" castshadow="true"/>',
    "studio": "",
}
SOLIDS = (
    '<geom type="sphere" size=".2" pos="0 0 .2"/><geom type="capsule" size=".05 .3" pos=".6 '
    '.2 .5"/>'
)


def backgrounds(gl, monkeypatch, size, body: str, **options) -> list[np.ndarray]:
    """Frame sizes that are no multiple of a block, with interpolated and exact backgrounds."""
    interpolated = frame_of(gl, body, size=size, **options)
    monkeypatch.setattr(deferred, "CoarseBackground", deferred.Background)
    return [interpolated, frame_of(gl, body, size=size, **options)]


@pytest.mark.parametrize("lamp", LAMPS)
@pytest.mark.parametrize("floor", ["0 0 .1", "1.2 .9 .1"], ids=["endless", "finite"])
@pytest.mark.parametrize("elevation", [-3.0, -25.0])
def test_the_interpolated_background_is_close_to_the_exact_one(
    gl, monkeypatch, lamp, floor, elevation
):
    body = f'{LAMPS[lamp]}<geom type="plane" size="{floor}" rgba=".8 .7 .6 1"/>{SOLIDS}'
    camera = Camera((0, 0, 0.2), 3.0, 70.0, elevation)
    interpolated, exact = backgrounds(gl, monkeypatch, (203, 151), body, camera=camera)
    assert exact.std() > 5
    assert np.abs(interpolated - exact).max() <= 3


@pytest.mark.parametrize(
    "solid",
    [
        (
            '<geom type="ellipsoid" size=".1 .3 .1" pos=".2 0 .4"/><geom type="box" size=".03 .2 '
            '.4" '
            'pos="-.3 0 .4"/>'
        ),
        '<geom type="box" size=".2 .2 .2" pos="0 0 .2" euler="0 0 20" rgba=".8 .2 .2 .6"/>',
    ],
    ids=["wide", "transparent"],
)
def test_interpolated_and_exact_penumbras_end_at_the_same_place(gl, monkeypatch, solid):
    body = '<geom type="plane" size="0 0 .1" rgba=".8 .7 .6 1"/>' + solid
    camera = Camera((0, 0, 0.2), 1.3, 110.0, -22.0)
    interpolated, exact = backgrounds(gl, monkeypatch, (803, 451), body, camera=camera)
    assert np.abs(interpolated - exact).max() <= 8


def test_the_colour_of_a_large_image_takes_little_memory() -> None:
    """All texels as numbers take 2 GB; a sample of an even mix has the same mean."""
    body = '<worldbody><geom type="plane" size="1 1 1" material="c"/></worldbody>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{CHECKER.format(4096, '')}</asset>{body}</mujoco>"
    )
    assets = Assets(model, MagicMock())
    assets.texture = MagicMock()
    tracemalloc.start()
    floor = Floor(assets, 0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    np.testing.assert_allclose(floor.albedo, 0.5, atol=1e-3)
    assert peak < 1e9
