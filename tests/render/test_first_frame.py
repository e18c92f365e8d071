"""The first frame is as good as any, and any as the first: nothing is read from the GPU before it is drawn."""

import dataclasses
from collections.abc import Callable
from typing import Any

import moderngl
import mujoco
import numpy as np
import pytest
from drawn import BALL, FLOOR, FRONT, SIZE, SUN, ball_surface

from ripple_sim.render import Renderer
from ripple_sim.render.resources import Resources

SKY = '<texture type="skybox" builtin="gradient" rgb1=".3 .5 .7" rgb2="0 0 0" width="16" height="96"/>'
TILES = '<texture name="tiles" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".1 .2 .3" width="8" height="8"/>'
MIRROR = '<material name="floor" texture="tiles" texrepeat="5 5" reflectance=".4"/>'
REFLECTING = FLOOR.replace("rgba=", 'material="floor" rgba=')
GLASS = '<geom type="box" size=".4 .05 .4" pos=".2 -.6 .5" rgba=".2 .4 .8 .4"/>'
WATER = '<geom name="water" type="sphere" size=".5" pos="-.6 0 .6"/>'
SUNNY = SUN.format(0.4, "true")

CLEAR = BALL + FLOOR + GLASS + WATER + SUNNY
REFLECTED = BALL + REFLECTING + GLASS + WATER + SUNNY

SCENES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "plain": (BALL + FLOOR + SUNNY, "", {}),
    "mirror": (REFLECTED, SKY + TILES + MIRROR, {}),
    "mirror, linear light, one sample": (REFLECTED, SKY + TILES + MIRROR, {"linear": True, "samples": 0}),
    "transmission": (CLEAR, "", {}),
    "transparent background": (CLEAR, "", {"alpha": True}),
}


def renderer_of(gl, name: str) -> tuple[Renderer, mujoco.MjData]:
    body, asset, options = SCENES[name]
    model = mujoco.MjModel.from_xml_string(f"<mujoco><asset>{asset}</asset><worldbody>{body}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    targets = {model.geom("water").id: ball_surface("water")} if WATER in body else {}
    return Renderer(gl, model, targets, size=SIZE, **options), data


def shown(renderer: Renderer, data: mujoco.MjData) -> np.ndarray:
    return renderer.render(data, {}, FRONT)


def blurred(renderer: Renderer, data: mujoco.MjData) -> np.ndarray:
    """Through two points of the lens, as frames with depth of field are made."""
    lenses = (0.1, 0.0), (-0.05, 0.08)
    eyes = (dataclasses.replace(FRONT.pose(), lens=lens, focal_distance=3.0) for lens in lenses)
    return np.stack([renderer.render(data, {}, eye, number) for number, eye in enumerate(eyes)])


def passes(renderer: Renderer, data: mujoco.MjData) -> np.ndarray:
    """Depths, normals, geoms and so on."""
    return np.concatenate([np.atleast_3d(each).astype(float) for each in renderer.surfaces(data, {}, FRONT)], axis=2)


DRAWN = [
    *(pytest.param(name, shown, id=name) for name in SCENES),
    *(pytest.param(name, blurred, id=f"depth of field, {name}") for name in ("mirror", "transmission")),
    *(pytest.param(name, passes, id=f"passes, {name}") for name in ("plain", "transmission")),
]
Draw = Callable[[Renderer, mujoco.MjData], np.ndarray]


@pytest.mark.parametrize(("name", "draw"), DRAWN)
def test_the_first_frame_of_a_still_scene_is_like_the_second(gl, name: str, draw: Draw):
    renderer, data = renderer_of(gl, name)
    with renderer:
        first = draw(renderer, data)
        np.testing.assert_array_equal(first, draw(renderer, data))


@pytest.mark.parametrize("name", SCENES)
def test_nothing_is_left_of_the_last_frame(gl, name: str):
    """Where the ball was, what is behind it shows as if it had never been there."""
    renderer, data = renderer_of(gl, name)
    with renderer:
        expected = shown(renderer, data)
        data.geom_xpos[0] += [0.7, 0.0, 0.3]
        assert (shown(renderer, data) != expected).any()
        data.geom_xpos[0] -= [0.7, 0.0, 0.3]
        np.testing.assert_array_equal(shown(renderer, data), expected)


@pytest.mark.parametrize(("name", "draw"), DRAWN)
def test_nothing_is_read_before_it_is_drawn(gl, name: str, draw: Draw, monkeypatch: pytest.MonkeyPatch):
    """Whatever the GPU's memory holds at first, the frame is the same bit for bit."""

    def frame() -> np.ndarray:
        renderer, data = renderer_of(gl, name)
        with renderer:
            return draw(renderer, data)

    expected = frame()
    create = Resources.__getattr__
    for depth in (0.0, 0.5):

        def create_filled(resources: Resources, method: str, depth: float = depth) -> Any:
            def created(*arguments: Any, **options: Any) -> Any:
                made = create(resources, method)(*arguments, **options)
                if isinstance(made, moderngl.Buffer) or len(arguments) < 3:  # of others the third is what they hold
                    with gl as ctx:
                        fill(ctx, made, depth, "reserve" in options)
                return made

            return created

        monkeypatch.setattr(Resources, "__getattr__", create_filled)
        np.testing.assert_array_equal(frame(), expected)


def fill(ctx: moderngl.Context, made: Any, depth: float, empty: bool) -> None:
    """Fill what was made without contents with what cannot be missed where it is read: NaN where there is one."""
    if isinstance(made, moderngl.Buffer):
        if empty:
            made.write(b"\xff" * made.size)
    elif isinstance(made, moderngl.TextureArray):
        made.write(np.full((*made.size, made.components), np.nan, made.dtype).tobytes())
    elif isinstance(made, moderngl.Texture | moderngl.Renderbuffer):
        target = ctx.framebuffer(depth_attachment=made) if made.depth else ctx.framebuffer([made])
        color = np.nan if made.dtype in ("f2", "f4") else 0.7
        target.clear(color, color, color, color, depth=depth)
        target.release()
