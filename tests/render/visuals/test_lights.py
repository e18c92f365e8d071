"""The rest of a MuJoCo scene: lamps, materials, textures, height fields, reflections, transparency."""

import gc

import mujoco
import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from ripple_sim.errors import RippleWarning
from ripple_sim.render import Camera, Renderer, Surface
from ripple_sim.render.visuals import primitives as meshes
from ripple_sim.render.visuals.lights import model_lighting
from ripple_sim.render.visuals.meshes import height_field
from ripple_sim.solver import RippleError
from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import GLContext, shared_context

SIZE = (160, 120)
ABOVE = Camera((0.0, 0.0, 0.0), 4.0, 90.0, -89.9, 40.0)  # the picture's up is +y, its right +x
FRONT = Camera((0.0, 0.0, 0.5), 4.0, 90.0, -10.0, 40.0)


@pytest.fixture(scope="module")
def gl() -> GLContext:
    try:
        return shared_context()
    except GLError as error:
        pytest.skip(f"no OpenGL context: {error}")


def picture(gl, body, *, asset="", visual="", camera=ABOVE, targets=None, size=SIZE, **options):
    xml = f"<mujoco><visual>{visual}</visual><asset>{asset}</asset><worldbody>{body}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    surfaces = {model.geom(name).id: surface for name, surface in (targets or {}).items()}
    with Renderer(gl, model, surfaces, size=size, **options) as renderer:
        return renderer.render(data, {}, camera).astype(int)


def ball_surface(look: str) -> Surface:
    ball = meshes.ball(8)
    return Surface(0.5 * ball.shell, ball.faces, ball.shell, 8, look)


FLOOR = '<geom type="plane" size="0 0 .1" rgba=".8 .8 .8 1"/>'
BALL = '<geom type="sphere" size=".3" pos="0 0 .8" rgba=".8 .2 .2 1"/>'
SUN = '<light directional="true" pos="0 0 3" dir="{} 0 -1" diffuse=".8 .8 .8" castshadow="{}"/>'
SPOT = '<light pos="{} 0 2" dir="{} 0 -1" diffuse=".9 .9 .9" cutoff="60" exponent="1"/>'


@pytest.mark.parametrize("direction", [-1.0, 1.0])
def test_a_shadow_falls_where_the_lamp_of_the_mjcf_throws_it(gl, direction):
    frame = picture(gl, FLOOR + BALL + SUN.format(direction, "true"))
    left, right = frame[50:70, 40:50].mean(), frame[50:70, 110:120].mean()
    assert (right < left - 60) if direction > 0 else (left < right - 60)


def test_a_lamp_without_castshadow_throws_none(gl):
    frame = picture(gl, FLOOR + BALL + SUN.format(1.0, "false"))
    assert abs(frame[50:70, 40:50].mean() - frame[50:70, 110:120].mean()) < 12


def test_a_near_lamp_throws_a_shadow_away_from_itself(gl):
    """A lamp at x = -1, 2 m up: the ball's middle at 0.8 m lies in the way to x = 0.67 on the floor."""
    frame = picture(gl, FLOOR + BALL + SPOT.format(-1.0, 0.5))
    pixels = SIZE[1] / (2 * 4.0 * np.tan(np.radians(20)))
    spot = int(SIZE[0] / 2 + 0.75 * pixels)
    assert frame[56:64, spot - 3 : spot + 3].mean() < frame[56:64, spot - 70 : spot - 64].mean() - 40


@pytest.mark.parametrize("lamps", [2, 3, 4])
def test_every_lamp_throws_its_shadow(gl, lamps):
    """Each of up to four suns, from four sides, darkens the floor where the ball stands in its way."""
    sun = '<light directional="true" pos="0 0 3" dir="{} {} -1" diffuse=".2 .2 .2" castshadow="{}"/>'
    ways = [(1, 0), (-1, 0), (0, 1), (0, -1)][:lamps]
    plain = picture(gl, FLOOR + BALL + "".join(sun.format(*way, "false") for way in ways))
    shaded = picture(gl, FLOOR + BALL + "".join(sun.format(*way, "true") for way in ways))
    pixels = SIZE[1] / (2 * 4.0 * np.tan(np.radians(20)))
    for x, y in ways:  # the ball's middle, 0.8 m up, throws its shadow 0.8 m away
        column, row = int(SIZE[0] / 2 + 0.8 * x * pixels), int(SIZE[1] / 2 - 0.8 * y * pixels)
        here = np.s_[row - 2 : row + 2, column - 2 : column + 2]
        assert shaded[here].mean() < plain[here].mean() - 6
    beside = np.s_[:8, :8]
    assert abs(shaded[beside].mean() - plain[beside].mean()) < 1


def test_more_lamps_than_can_throw_shadows_shine_all_the_same(gl):
    suns = "".join(SUN.format(x, "true").replace(".8 .8 .8", ".1 .1 .1") for x in np.linspace(-1, 1, 6))
    assert picture(gl, FLOOR + BALL + suns)[:8].mean() > picture(gl, FLOOR + BALL, lighting="model")[:8].mean() + 20


def test_a_near_lamp_and_a_sun_throw_shadows_side_by_side(gl):
    pixels = SIZE[1] / (2 * 4.0 * np.tan(np.radians(20)))
    sun = SUN.format(-1.0, "{}").replace(".8 .8 .8", ".4 .4 .4")
    spot = SPOT.format(-1.0, 0.5).replace("/>", ' castshadow="{}"/>')
    places = [int(SIZE[0] / 2 + x * pixels) for x in (-0.8, 0.75)]
    frames = {
        flags: picture(gl, FLOOR + BALL + sun.format(flags[0]) + spot.format(flags[1]))
        for flags in (("false", "false"), ("true", "true"))
    }
    plain, shaded = ([frame[56:64, x - 3 : x + 3].mean() for x in places] for frame in frames.values())
    assert shaded[0] < plain[0] - 6
    assert shaded[1] < plain[1] - 6


def test_a_shadow_falls_far_below_its_body(gl):
    """A small ball ten of its radii above the floor, lit from the left."""
    ball = '<geom type="sphere" size=".1" pos="-.5 0 1" rgba=".8 .2 .2 1"/>'
    frame = picture(gl, FLOOR + ball + SUN.format(1.0, "true"))
    pixels = SIZE[1] / (2 * 4.0 * np.tan(np.radians(20)))
    x = int(SIZE[0] / 2 + 0.5 * pixels)
    assert frame[58:62, x - 2 : x + 2].mean() < frame[58:62, x + 20 : x + 30].mean() - 60


def test_the_edges_of_a_coarse_ball_do_not_shade_it(gl):
    """A small picture, whose ball has few triangles, looks as a large one does."""
    scene = FLOOR + BALL + SUN.format(1.0, "true")
    small = picture(gl, scene, camera=FRONT)
    large = picture(gl, scene, camera=FRONT, size=(4 * SIZE[0], 4 * SIZE[1]))
    large = large.reshape(SIZE[1], 4, SIZE[0], 4, 3).mean(axis=(1, 3))
    ball = binary_erosion(large[..., 0] - large[..., 2] > 60, iterations=2)
    assert np.abs(small - large)[ball].max() < 20


def test_no_lamp_in_the_mjcf_means_the_studio_and_both_can_be_asked_for(gl):
    dark = "<headlight active='0'/>"
    sun = SUN.format(1.0, "true")
    np.testing.assert_array_equal(picture(gl, FLOOR + BALL), picture(gl, FLOOR + BALL, lighting="studio"))
    np.testing.assert_array_equal(picture(gl, FLOOR + BALL + sun), picture(gl, FLOOR + BALL + sun, lighting="model"))
    assert picture(gl, FLOOR + BALL, visual=dark, lighting="model").mean() < 40
    with pytest.raises(RippleError, match=r"'dusk'.*'auto', 'model', 'studio'"):
        picture(gl, FLOOR, lighting="dusk")


def test_light_adds_up_to_mujocos_brightness_in_both_extremes():
    xml = f"""<mujoco><visual><headlight ambient=".2 .2 .2" diffuse=".3 .3 .3"/></visual>
    <worldbody>{SUN.format(0.0, "true").replace(".8 .8 .8", ".4 .4 .4")}</worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lighting = model_lighting(model, data, ABOVE.pose())
    total = lighting.ambient + lighting.on(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    # MuJoCo's sums, from sRGB to linear light
    np.testing.assert_allclose(lighting.ambient, ((0.2 + 0.055) / 1.055) ** 2.4, rtol=1e-6)
    np.testing.assert_allclose(total, ((0.9 + 0.055) / 1.055) ** 2.4, rtol=1e-3)
    assert lighting.lights[0].shadow


def test_the_beam_of_a_spot_falls_off_in_srgb_as_in_mujoco():
    """At 60 degrees from the axis, MuJoCo's cosine to the power of 2 leaves a quarter of the light, in sRGB."""
    lamp = '<light pos="0 0 1" dir="0 0 -1" diffuse=".5 .5 .5" cutoff="80" exponent="2"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><visual><headlight active="0"/></visual><worldbody>{lamp}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lighting = model_lighting(model, data, ABOVE.pose())
    beside = np.array([np.sqrt(3.0), 0.0, 0.0])
    towards = np.array([-np.sqrt(3.0), 0.0, 1.0]) / 2
    under, aside = lighting.on(np.zeros(3), np.array([0.0, 0.0, 1.0])), lighting.on(beside, towards)
    np.testing.assert_allclose((aside / under) ** (1 / 2.2), 0.25, rtol=1e-6)


def test_a_scene_lit_by_a_spot_alone_is_dark_all_round(gl):
    spot = SPOT.format(0.0, 0.0).replace('exponent="1"', 'exponent="20"')
    dark = picture(gl, FLOOR + BALL + spot, visual='<headlight active="0"/>', camera=FRONT)
    light = picture(gl, FLOOR + BALL + SUN.format(0.0, "true"), visual='<headlight active="0"/>', camera=FRONT)
    assert dark[:10].mean() < 20 < 80 < light[:10].mean()
    assert dark.max() > 100


def test_skybox_fills_the_background(gl):
    sky = '<texture type="skybox" builtin="flat" rgb1=".1 .2 .9" width="16" height="96"/>'
    frame = picture(gl, SUN.format(0.0, "true"), asset=sky, camera=FRONT)
    # bright colours pale a little
    np.testing.assert_allclose(frame.mean(axis=(0, 1)), 255 * np.array([0.1, 0.2, 0.9]), atol=12)
    assert frame.std(axis=(0, 1)).max() < 1


def test_floor_texture_repeats_as_in_mujoco(gl):
    """A repetition of a 2 x 2 checker is 2 m wide and begins at -1 m: squares of 1 m, a corner at the origin."""
    asset = (
        '<texture name="c" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0" width="64" height="64"/>'
        '<material name="c" texture="c" texuniform="true"/>'
    )
    frame = picture(gl, '<geom type="plane" size="0 0 .1" material="c"/>', asset=asset)
    pixels = int(0.5 * SIZE[1] / (2 * 4.0 * np.tan(np.radians(20))))  # half a square
    y, x = SIZE[1] // 2, SIZE[0] // 2
    quarters = np.array([[frame[y + b * pixels, x + a * pixels].mean() for a in (-1, 1)] for b in (-1, 1)])
    assert abs(quarters[0, 0] - quarters[1, 1]) < 15
    assert abs(quarters[0, 1] - quarters[1, 0]) < 15
    assert abs(quarters[0, 0] - quarters[0, 1]) > 100


def test_height_field_stands_as_high_as_it_says():
    model = mujoco.MjModel.from_xml_string("""<mujoco>
      <asset><hfield name="h" nrow="3" ncol="4" size="2 1 .5 .1"/></asset>
      <worldbody><geom type="hfield" hfield="h"/></worldbody></mujoco>""")
    model.hfield_data[:] = np.linspace(0, 1, 12)
    shape = height_field(model, 0)
    np.testing.assert_allclose(shape.shell.min(axis=0), [-2, -1, -0.1])
    np.testing.assert_allclose(shape.shell.max(axis=0), [2, 1, 0.5])
    top = shape.shell[shape.shell[:, 2] > -0.05]
    corner = top[np.argmin(top @ [1, 1, 0])]
    np.testing.assert_allclose(corner, [-2, -1, 0], atol=1e-6)
    V, F = shape.shell, shape.faces
    cross = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    outwards = V[F].mean(axis=1) - [0, 0, 0.1]
    assert np.einsum("ij,ij->i", cross, outwards).min() > 0


def test_groups_above_two_are_hidden(gl):
    hidden = BALL.replace("/>", ' group="3"/>')
    np.testing.assert_array_equal(picture(gl, FLOOR + hidden), picture(gl, FLOOR))
    assert np.abs(picture(gl, FLOOR + BALL) - picture(gl, FLOOR)).max() > 60


def test_sites_of_visible_groups_are_drawn_like_bodies(gl):
    """As MuJoCo draws them: round, in their colour or their material's, clear where they are, with a shadow."""
    site = '<site type="sphere" size=".3" pos="0 0 .8" {}/>'
    plain = picture(gl, FLOOR, camera=FRONT)
    as_body = picture(gl, FLOOR + BALL, camera=FRONT)
    as_site = picture(gl, FLOOR + site.format('rgba=".8 .2 .2 1"'), camera=FRONT)
    ball = (as_body[..., 0] - as_body[..., 2] > 60) & (as_site[..., 0] - as_site[..., 2] > 60)
    assert ball.sum() > 400
    upper = ball & (np.arange(SIZE[1])[:, None] < 45)  # of the floor's light the body shades itself a little
    np.testing.assert_allclose(as_site[upper], as_body[upper], atol=16)
    np.testing.assert_array_equal(picture(gl, FLOOR + site.format('group="3"'), camera=FRONT), plain)
    clear = picture(gl, FLOOR + site.format('rgba=".8 .2 .2 .3"'), camera=FRONT)
    assert (as_site[ball][:, 0] - as_site[ball][:, 2]).mean() > 2 * (clear[ball][:, 0] - clear[ball][:, 2]).mean() > 10
    green = picture(gl, site.format('material="g"'), asset='<material name="g" rgba="0 .8 0 1"/>', camera=FRONT)
    assert (green[ball][:, 1] > green[ball][:, 0] + 60).mean() > 0.9


def test_sites_hide_no_sky(gl):
    """Under a wide site the floor stays as light as without it where no lamp shines."""
    roof = '<site type="box" size=".5 .5 .02" pos="0 0 .4" rgba="1 0 0 1"/>'
    light = {"visual": '<headlight ambient=".5 .5 .5" diffuse="0 0 0"/>', "lighting": "model", "camera": FRONT}
    frames = [picture(gl, FLOOR + body, **light) for body in (roof, roof.replace("site", "geom"), "")]
    under = np.s_[78:82, 75:85]
    site, geom, none = (frame[under].mean() for frame in frames)
    assert abs(site - none) < 1
    assert geom < none - 10


def test_the_edges_of_a_finite_floor_are_smooth(gl):
    """A white square in front of black: along its slanted edges lie pixels of all shades."""
    floor = '<geom type="plane" size=".5 .5 .1" euler="0 0 20" rgba="1 1 1 1"/>'
    sky = '<texture type="skybox" builtin="flat" rgb1="0 0 0" rgb2="0 0 0" width="16" height="96"/>'
    frame = picture(gl, floor + SUN.format(0.0, "false"), asset=sky)[..., 0]
    white = frame[60, 80]
    edge = (frame > 0.2 * white) & (frame < 0.8 * white)
    assert 40 < edge.sum() < 200
    shares = np.histogram(frame[edge] / white, bins=3, range=(0.2, 0.8))[0]
    assert shares.min() > 8


def test_a_reflecting_floor_shows_the_ball_upside_down(gl):
    def frame(reflectance: float):
        asset = f'<material name="f" rgba=".4 .4 .4 1" reflectance="{reflectance}"/>'
        floor = '<geom type="plane" size="0 0 .1" material="f"/>'
        ball = BALL.replace(".8 .2 .2", "1 0 0")
        return picture(gl, floor + ball, asset=asset, camera=Camera((0, 0, 0), 4.0, 90.0, -20.0, 40.0))

    redder = [(f[..., 0] - f[..., 2])[70:110, 70:90].max() for f in (frame(0.0), frame(0.5))]
    assert redder[1] > redder[0] + 40


def test_alpha_leaves_the_bodies_and_their_shadows(gl):
    whole = picture(gl, FLOOR + BALL + SUN.format(0.5, "true"), camera=FRONT)
    frame = picture(gl, FLOOR + BALL + SUN.format(0.5, "true"), camera=FRONT, alpha=True)
    assert frame.shape == (SIZE[1], SIZE[0], 4)
    assert frame[0, 0, 3] == 0
    ball = binary_erosion(np.abs(whole[..., 0] - whole[..., 2]) > 60, iterations=2)
    assert ball.sum() > 200
    assert (frame[ball][:, 3] == 255).all()
    np.testing.assert_allclose(frame[ball][:, :3], whole[ball], atol=1)
    shadow = (np.abs(frame[..., :3]).max(axis=2) == 0) & (frame[..., 3] > 100)
    assert shadow.sum() > 50


def test_a_clear_body_lets_what_is_behind_through(gl):
    wall = '<geom type="box" size="3 .1 3" pos="0 2 0" rgba="0 0 1 1"/>'
    glass = '<geom type="box" size=".5 .02 .5" pos="0 0 .5" rgba="1 0 0 {}"/>'
    middle = np.s_[55:65, 75:85]
    red, mixed, blue = (
        picture(gl, wall + pane, camera=FRONT)[middle].mean(axis=(0, 1))
        for pane in (glass.format(1.0), glass.format(0.5), "")
    )
    np.testing.assert_allclose(mixed, (red + blue) / 2, atol=12)


def test_a_clear_plane_is_drawn_too(gl):
    pane = '<geom type="plane" size=".5 .5 .1" pos="0 0 .5" rgba="1 0 0 .5"/>'
    assert (picture(gl, FLOOR + pane) - picture(gl, FLOOR))[60, 80, 2] < -40


def test_the_model_look_takes_the_material_of_the_geom(gl):
    asset = '<material name="green" rgba="0 .8 0 1"/>'
    body = '<geom name="t" type="sphere" size=".5" pos="0 0 .5" material="green"/>'
    middle = np.s_[55:65, 75:85]
    shown = picture(gl, body, asset=asset, camera=FRONT, targets={"t": ball_surface("model")})[middle].mean(axis=(0, 1))
    assert shown[1] > shown[0] + 60
    assert shown[1] > shown[2] + 60


def test_what_is_not_drawn_is_said_once(gl):
    body = (
        """<body name="a" pos="0 0 1"><joint type="slide"/><geom size=".1"/><site name="s"/></body><site name="w"/>"""
    )
    tendon = '<tendon><spatial><site site="s"/><site site="w"/></spatial></tendon>'
    xml = f"<mujoco><worldbody>{body}</worldbody>{tendon}</mujoco>"
    with pytest.warns(RippleWarning, match="1 tendons"):
        Renderer(gl, mujoco.MjModel.from_xml_string(xml), {}, size=(32, 24)).close()


def test_fifty_renderers_leave_nothing_behind(gl):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{FLOOR}{BALL}</worldbody></mujoco>")

    def make() -> int:
        renderer = Renderer(gl, model, {}, size=(16, 12), samples=0)
        made = list(renderer._resources._created)
        del renderer
        gc.collect()
        with gl:
            return sum(type(each.mglo).__name__ != "InvalidObject" for each in made)

    assert [make() for _ in range(50)] == [0] * 50
