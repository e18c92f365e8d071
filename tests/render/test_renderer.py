"""Frames against closed-form geometry and a brute-force reference, drawn large and shrunk."""

import numpy as np
import pytest
from drawn import ball_surface
from mujoco_models import posed
from scipy.ndimage import gaussian_filter
from sphere_height_maps import N, constant_height_map, cube_charts, height_map_of, linear_height_map

from ripple_sim.render import Camera, Renderer, Surface
from ripple_sim.render.visuals import shapes
from ripple_sim.solver import HeightMap, sphere_atlas

SIZE = (240, 180)
FRONT = Camera(lookat=(0.0, 0.0, 0.0), distance=4.0, azimuth=90.0, elevation=0.0, fovy=40.0)
LONE_BALL = '<mujoco><worldbody><geom name="target" type="sphere" size="1"/></worldbody></mujoco>'

# of the frame that is compared with a brute-force reference
RESOLUTION = 96
SHOWN = (320, 240)
FINER = 3  # times as many pixels along an edge of the reference
WAVES = np.array([[7.0, 2.0, -3.0], [-2.0, 8.0, 4.0], [3.0, -5.0, 9.0]])  # [1/m]
BALLS = """
<mujoco>
  <worldbody>
    <light directional="true" pos="0 0 4" dir="-.5 .4 -1" diffuse=".7 .7 .7"/>
    <geom type="plane" size="20 20 .1" rgba=".7 .7 .75 1"/>
    <geom name="target" type="sphere" size="1" pos="0 0 1.05"/>
    <geom type="sphere" size=".2" pos=".2 -1 1.6" rgba=".2 .3 .7 1"/>
    <geom type="box" size=".3 .2 .2" pos="1.4 -.6 .2" rgba=".7 .3 .2 1"/>
  </worldbody>
</mujoco>
"""


def make(gl, xml=LONE_BALL, surface=None, size=SIZE, **options):
    model, data = posed(xml)
    target = model.geom("target").id
    renderer = Renderer(
        gl, model, {target: surface or ball_surface("clay", 1.0, N)}, size=size, **options
    )
    return renderer, data, target


def silhouette(gl, surface, height_map) -> np.ndarray:
    """Pixels that a target covers: a frame without the target differs there."""
    renderer, data, target = make(gl, surface=surface)
    frame = renderer.render(data, {target: height_map}, FRONT).astype(int)
    data.geom_xpos[target] = [0.0, -50.0, 0.0]
    empty = renderer.render(data, {}, FRONT).astype(int)
    return np.abs(frame - empty).max(axis=2) > 4


def test_constant_height_looks_like_a_larger_sphere(gl):
    raised = silhouette(gl, ball_surface("clay", 1.0, N), constant_height_map(0.25))
    larger = silhouette(gl, ball_surface("clay", 1.25, N), constant_height_map(0.0))
    plain = silhouette(gl, ball_surface("clay", 1.0, N), constant_height_map(0.0))
    assert (raised != larger).mean() < 1e-3
    # and both as large as perspective says: the cone that touches a ball of radius r at distance D
    _, height = SIZE
    half_angle = np.radians(FRONT.fovy / 2)
    for pixels, radius in ((raised, 1.25), (plain, 1.0)):
        tangent = radius / np.sqrt(FRONT.distance**2 - radius**2)
        shown_radius = tangent / np.tan(half_angle) * height / 2  # [pixels]
        # the silhouette is a polygon, and pixels on it count or not
        assert pixels.sum() == pytest.approx(np.pi * shown_radius**2, rel=0.02)


def test_constant_height_shades_as_flat(gl):
    """Without a gradient, the shading normal is that of the flat surface at any height."""
    renderer, data, target = make(gl)
    flat = renderer.render(data, {target: constant_height_map(0.0)}, FRONT).astype(int)
    raised = renderer.render(data, {target: constant_height_map(0.002)}, FRONT).astype(int)
    inner = np.s_[50:130, 80:160]
    assert flat[inner].std() > 5
    assert np.abs(flat[inner] - raised[inner]).max() <= 3


def test_a_slope_that_faces_the_light_is_brighter(gl):
    """The key light stands on the left.

    A height that grows to the right turns the surface towards it.
    """
    renderer, data, target = make(gl)
    slope = np.array([0.5, 0.0, 0.0])

    def no_height(d):
        return np.zeros(d.shape[:3])

    def tangential_slope(d):
        return slope - (d @ slope)[..., None] * d

    def brightness(height_map) -> float:
        middle = np.s_[80:100, 110:130]
        return renderer.render(data, {target: height_map}, FRONT)[middle].mean()

    flat = brightness(constant_height_map(0.0))
    tilted = brightness(height_map_of(no_height, tangential_slope))
    assert tilted > flat + 20


@pytest.mark.parametrize(
    "direction", [(1, 1, 0), (1, 0, 1), (0, 1, -1), (1, 1, 1), (-1, 1, -1), (-1, -1, 1)], ids=str
)
def test_ripples_run_on_across_cube_edges_and_corners(gl, direction):
    """Neighbouring pixels differ no more at an edge or corner of the cube than elsewhere."""
    slope = np.array([0.11, -0.07, 0.05])
    height_map = linear_height_map(slope)
    renderer, data, target = make(gl, size=(160, 160), samples=0)

    def steps(d) -> float:
        d = np.array(d, dtype=float) / np.linalg.norm(d)
        azimuth = np.degrees(np.arctan2(-d[1], -d[0]))
        elevation = np.degrees(np.arcsin(-d[2]))
        camera = Camera(tuple(d), 0.8, azimuth, elevation, 30.0)
        frame = renderer.render(data, {target: height_map}, camera).astype(int)
        # second differences: a smooth gradient has none, a kink or a crack has
        bends = [np.abs(np.diff(frame, n=2, axis=axis)).max() for axis in (0, 1)]
        return max(bends)

    middles_of_faces = [row for row in np.diag(direction) if row.any()]
    largest = max(steps(middle) for middle in middles_of_faces)
    assert steps(direction) <= largest + 2  # codes of 255


def test_height_maps_of_different_resolutions_stay_apart(gl):
    """Targets that swell each by its own height cover what balls of these radii cover."""
    balls = "<geom size='.5' pos='-.8 0 0'/><geom size='.5' pos='.8 0 0'/>"
    (model, data) = posed(f"<mujoco><worldbody>{balls}</worldbody></mujoco>")
    ball = shapes.ball(16)
    resolutions = (8, 20)
    heights = (0.25, 0.1)

    def frame(radii: list[float], swell: tuple[float, float]) -> np.ndarray:
        surfaces = {}
        height_maps = {}
        for geom, n in enumerate(resolutions):
            V = radii[geom] * ball.shell
            surfaces[geom] = Surface(V, ball.faces, cube_charts(ball.shell, n), "clay")
            gradient_and_height = [0, 0, 0, swell[geom]]
            with_halo = (6, n + 2, n + 2, 4)
            height_maps[geom] = np.full(with_halo, gradient_and_height, dtype=np.float32)
        with Renderer(gl, model, surfaces, size=(203, 151)) as renderer:
            return renderer.render(data, height_maps, Camera((0, 0, 0), 4.0, 90.0, 0.0)).astype(int)

    def share_of_other_pixels(one: np.ndarray, other: np.ndarray) -> float:
        return (np.abs(one - other).max(axis=2) > 24).mean()  # codes of 255

    swollen = frame([0.5, 0.5], heights)
    larger = frame([0.5 + h for h in heights], (0.0, 0.0))
    plain = frame([0.5, 0.5], (0.0, 0.0))
    assert share_of_other_pixels(swollen, larger) < 2e-3  # pixels on silhouettes
    assert share_of_other_pixels(swollen, plain) > 0.02


def height(points):
    """Displacement [m] at points of the unit sphere."""
    return 0.03 * np.sin(points @ WAVES.T).mean(axis=-1) + 0.02 * points[..., 2]


def fine_frame(gl, surface, height_map, factor):
    model, data = posed(BALLS)
    target = model.geom("target").id
    camera = Camera((0.0, 0.0, 0.8), 4.5, 100.0, -25.0)
    size = (factor * SHOWN[0], factor * SHOWN[1])
    with Renderer(gl, model, {target: surface}, size=size) as renderer:
        return renderer.render(data, {target: height_map} if height_map is not None else {}, camera)


def shrunk(picture, factor):
    height, width, channels = picture.shape
    blocks = picture.reshape(height // factor, factor, width // factor, factor, channels)
    return blocks.astype(np.float64).mean(axis=(1, 3))


def similarity(a, b):
    """Mean structural similarity of two pictures (Wang et al. 2004), window of 1.5 pixels."""

    def blur(x):
        return gaussian_filter(x, (1.5, 1.5, 0.0), truncate=3.5)

    mean_a = blur(a)
    mean_b = blur(b)
    var_a = blur(a * a) - mean_a**2
    var_b = blur(b * b) - mean_b**2
    both = blur(a * b) - mean_a * mean_b
    c1 = (0.01 * 255) ** 2
    c2 = (0.03 * 255) ** 2
    ssim = (
        (2 * mean_a * mean_b + c1)
        * (2 * both + c2)
        / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))
    )
    return float(ssim.mean())


def test_a_frame_matches_the_brute_force_reference(gl):
    atlas = sphere_atlas(1.0, RESOLUTION)
    height_map = HeightMap(atlas.texels)(height(atlas.positions).astype(np.float32))
    ball = shapes.ball(24)
    still = Surface(ball.shell, ball.faces, cube_charts(ball.shell, RESOLUTION), "rubber")
    fine = shapes.ball(60)
    V = (1.0 + height(fine.shell))[:, None] * fine.shell
    displaced = Surface(V, fine.faces, cube_charts(fine.shell, RESOLUTION), "rubber")
    reference = shrunk(fine_frame(gl, displaced, None, FINER), FINER)
    score = similarity(fine_frame(gl, still, height_map, 1).astype(np.float64), reference)
    assert score >= 0.98
    # the ripples do matter: without them the picture is another
    assert similarity(fine_frame(gl, still, None, 1).astype(np.float64), reference) < score - 0.01
