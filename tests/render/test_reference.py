"""Frames against a brute-force reference: geometry displaced in float64, very fine, drawn large and shrunk."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter
from sphere_height_maps import cube_charts

from ripple_sim.render import Camera, Renderer, Surface
from ripple_sim.render.visuals import shapes as meshes
from ripple_sim.solver import HeightMap, sphere_atlas
from ripple_sim.solver.errors import GLError
from ripple_sim.solver.gl import shared_context

N = 96
SIZE = (320, 240)
FINER = 4
WAVES = np.array([[7.0, 2.0, -3.0], [-2.0, 8.0, 4.0], [3.0, -5.0, 9.0]])  # [1/m]
SCENE = """
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


def height(points):
    """Displacement [m] at points of the unit sphere."""
    return 0.03 * np.sin(points @ WAVES.T).mean(axis=-1) + 0.02 * points[..., 2]


def displaced_ball(divisions: int) -> Surface:
    ball = meshes.ball(divisions)
    return Surface((1.0 + height(ball.shell))[:, None] * ball.shell, ball.faces, cube_charts(ball.shell, N), "rubber")


def frame(surface, height_map, factor):
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    target = model.geom("target").id
    camera = Camera((0.0, 0.0, 0.8), 4.5, 100.0, -25.0)
    size = (factor * SIZE[0], factor * SIZE[1])
    with Renderer(shared_context(), model, {target: surface}, size=size) as renderer:
        return renderer.render(data, {target: height_map} if height_map is not None else {}, camera)


def shrunk(picture, factor):
    height, width, channels = picture.shape
    blocks = picture.reshape(height // factor, factor, width // factor, factor, channels)
    return blocks.astype(np.float64).mean(axis=(1, 3))


def similarity(a, b):
    """Mean structural similarity of two pictures (Wang et al. 2004), by channels, Gaussian window of 1.5 pixels."""

    def blur(x):
        return gaussian_filter(x, (1.5, 1.5, 0.0), truncate=3.5)

    mean_a, mean_b = blur(a), blur(b)
    var_a, var_b, both = blur(a * a) - mean_a**2, blur(b * b) - mean_b**2, blur(a * b) - mean_a * mean_b
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    ssim = (2 * mean_a * mean_b + c1) * (2 * both + c2) / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))
    return float(ssim.mean())


def check(own, reference, least, folder: Path):
    score = similarity(own.astype(np.float64), reference)
    if score < least:
        difference = np.clip(128 + 4 * (own - reference), 0, 255)
        pictures = np.concatenate([own, reference, difference], axis=1).astype(np.uint8)
        Image.fromarray(pictures).save(folder / "own_reference_difference.png")
    assert score >= least, f"see {folder / 'own_reference_difference.png'}"


@pytest.fixture(scope="module", autouse=True)
def software_or_any_gl():
    try:
        shared_context()
    except GLError as error:
        pytest.skip(f"no OpenGL context: {error}")


def test_similarity_of_pictures():
    rng = np.random.default_rng(1)
    picture = rng.uniform(0, 255, (64, 64, 3))
    assert similarity(picture, picture) == pytest.approx(1.0)
    assert similarity(picture, picture + rng.normal(0, 60, picture.shape)) < 0.9


def test_a_frame_is_that_of_the_brute_force_reference(tmp_path):
    atlas = sphere_atlas(1.0, N)
    height_map = HeightMap(atlas.texels)(height(atlas.positions).astype(np.float32))
    ball = meshes.ball(24)
    own = frame(Surface(ball.shell, ball.faces, cube_charts(ball.shell, N), "rubber"), height_map, 1)
    reference = shrunk(frame(displaced_ball(90), None, FINER), FINER)
    check(own, reference, 0.98, tmp_path)
    # the ripples do matter: without them the picture is another
    flat = frame(Surface(ball.shell, ball.faces, cube_charts(ball.shell, N), "rubber"), None, 1)
    assert similarity(flat.astype(np.float64), reference) < similarity(own.astype(np.float64), reference) - 0.01
