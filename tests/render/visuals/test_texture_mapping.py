"""How the textures of MuJoCo's materials lie on its geoms, as in mujoco.Renderer since 3.12."""

import os

import mujoco
import numpy as np
import pytest
from mujoco_models import forwarded
from programs import PROGRAMS, ended
from scipy.ndimage import maximum_filter, minimum_filter
from sphere_height_maps import cube_charts
from textured import textured_model

from ripple_sim.render import Camera, Renderer, Surface
from ripple_sim.render.visuals import shapes

SIZE = 96
FROM_X = Camera((0.0, 0.0, 0.0), 4.0, 180.0, 0.0, 20.0)  # the frame's right is +y, its up +z


def names(gl, model, places, camera=FROM_X, targets=None) -> str:
    """Names of the colours at points of the frame [pixels], right and up of its middle."""
    with Renderer(gl, model, targets or {}, size=(SIZE, SIZE), lighting="studio") as renderer:
        frame = renderer.render(forwarded(model), {}, camera).astype(float)
    found = ""
    for x, y in places:
        column = SIZE // 2 + x
        row = SIZE // 2 - y
        rgb = frame[row - 1 : row + 2, column - 1 : column + 2].mean(axis=(0, 1))
        bright = rgb > 0.5 * (rgb.min() + rgb.max())
        found += {(1, 0, 0): "r", (0, 1, 0): "g", (0, 0, 1): "b", (1, 1, 0): "y"}.get(
            tuple(bright.astype(int)), "?"
        )
    return found


def corners(distance: int) -> list[tuple[int, int]]:
    return [
        (-distance, distance),
        (distance, distance),
        (-distance, -distance),
        (distance, -distance),
    ]


@pytest.mark.parametrize(
    ("shape", "look"), [("sphere", "model"), ("capsule", "model"), ("sphere", "rubber")]
)
def test_the_texture_of_a_target_lies_where_it_lies_on_other_geoms(gl, shape, look):
    model = textured_model(f'<geom type="{shape}" size=".4 .2" material="m"/>')
    ball = shapes.ball(12)
    V = 0.4 * ball.shell + (np.sign(ball.shell) * [0, 0, 0.2] if shape == "capsule" else 0.0)
    places = [*corners(5), *corners(12)]
    surface = Surface(V, ball.faces, cube_charts(ball.shell, 8), look)
    assert names(gl, model, places, targets={0: surface}) == names(gl, model, places)
    if look == "rubber":
        plain = Surface(V, ball.faces, cube_charts(ball.shell, 8), look, color=(0.0, 0.8, 0.0))
        assert names(gl, model, corners(5), targets={0: plain}) == "gggg"


def test_the_first_role_for_colours_is_found_among_layers(gl):
    roles = '<layer role="normal" texture="n"/><layer role="rgb" texture="t"/>'
    layers = f'<material name="m" specular="0">{roles}</material>'
    flat = '<texture name="n" type="2d" builtin="flat" rgb1=".5 .5 1" width="8" height="8"/>'
    model = textured_model(
        '<geom type="sphere" size=".4" material="m"/>', asset=flat, material=layers
    )
    assert names(gl, model, corners(9)) == "gryb"


def test_the_colour_of_the_geom_or_else_of_the_material_multiplies_the_texture(gl):
    """Yellow times red is red, and so on; a geom without a colour takes the material's."""
    yellow = [(10, -10)]
    assert (
        names(
            gl,
            textured_model('<geom type="box" size=".4 .4 .4" material="m" rgba="1 0 0 1"/>'),
            yellow,
        )
        == "r"
    )
    assert (
        names(
            gl,
            textured_model('<geom type="box" size=".4 .4 .4" material="m"/>', 'rgba="0 1 0 1"'),
            yellow,
        )
        == "g"
    )


SHELF = "".join(
    f'<geom type="{kind}" size="{size}" pos="{place} 0" euler="{turn}" material="m"/>'
    for kind, size, place, turn in [
        ("sphere", ".4", "-1.1 .55", "30 20 40"),
        ("ellipsoid", ".45 .3 .35", "0 .55", "70 20 -40"),
        ("capsule", ".22 .25", "1.1 .55", "60 40 0"),
        ("cylinder", ".35 .3", "-1.1 -.55", "40 20 110"),
        ("box", ".4 .3 .35", "0 -.55", "-40 30 200"),
        ("plane", ".4 .5 .1", "1.1 -.55", "10 -30 40"),
    ]
)


def colours(frame) -> np.ndarray:
    """Which of red, green and blue each pixel has."""
    frame = frame.astype(int)
    return frame > 0.5 * (frame.min(axis=2, keepdims=True) + frame.max(axis=2, keepdims=True))


@pytest.mark.skipif(
    tuple(map(int, mujoco.__version__.split(".")[:2])) < (3, 12),
    reason="MuJoCo laid pictures otherwise before 3.12",
)
def test_each_pixel_shows_what_mujocos_renderer_shows(gl, tmp_path):
    flat = ('texuniform="false"', 'texuniform="true" texrepeat="3 2"', 'texrepeat="2.5 1"')
    variants = [("2d", text) for text in flat] + [
        ("cube", f'texuniform="{each}"') for each in ("false", "true")
    ]
    body = SHELF + '<geom type="plane" size="0 0 .1" pos="0 0 -9"/>'
    models = [textured_model(body, text, kind=kind) for kind, text in variants]
    paths = [str(tmp_path / f"{i}.mjb") for i in range(len(models))]
    for model, path in zip(models, paths, strict=True):
        mujoco.mj_saveModel(model, path, None)
    environment = {**os.environ, "MUJOCO_GL": "egl"}
    program = PROGRAMS / "draw_with_mujoco.py"
    done = ended(program, tmp_path / "theirs.npy", *paths, env=environment)
    if done.returncode:
        pytest.skip(f"MuJoCo's renderer does not run here: {done.stderr[-200:]}")
    for model, theirs, variant in zip(
        models, np.load(tmp_path / "theirs.npy"), variants, strict=True
    ):
        with Renderer(gl, model, {}, size=(320, 240), lighting="studio") as renderer:
            ours = renderer.render(
                forwarded(model), {}, Camera((0.0, 0.0, 0.0), 4.2, 70.0, -50.0, 45.0)
            )
        theirs_shows = colours(theirs)
        ours_shows = colours(ours)
        # away from edges, where they show a clear colour
        bright = theirs.max(axis=2).astype(int) - theirs.min(axis=2) > 150
        same = np.stack(
            [minimum_filter(c, 5) | ~maximum_filter(c, 5) for c in np.moveaxis(theirs_shows, 2, 0)],
            axis=2,
        )
        inside = minimum_filter(bright, 5) & same.all(axis=2)
        agree = (theirs_shows == ours_shows).all(axis=2)[inside]
        assert inside.sum() > 3000, variant
        assert agree.mean() > 0.99, variant
