"""The first frame is as good as any, and any as the first: nothing is read from the GPU before it is drawn."""

import dataclasses
from typing import Any

import moderngl
import mujoco
import numpy as np
import pytest
from drawn import BALL, FLOOR, FRONT, SIZE, ball_surface

from ripple_sim.render import Renderer
from ripple_sim.render.resources import Resources

TILES = '<texture name="tiles" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".1 .2 .3" width="8" height="8"/>'
MIRROR = '<material name="floor" texture="tiles" texrepeat="5 5" reflectance=".4"/>'
REFLECTING = FLOOR.replace("rgba=", 'material="floor" rgba=')
GLASS = '<geom type="box" size=".4 .05 .4" pos=".2 -.6 .5" rgba=".2 .4 .8 .4"/>'
WATER = '<geom name="water" type="sphere" size=".5" pos="-.6 0 .6"/>'
REST = BALL + GLASS + WATER  # lit by the studio's single light, whose shaders are the quickest to compile

# every pass, every format of a frame, and the background both at once and from a coarse one
SCENES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "smooth background": (FLOOR + REST, "", {}),
    "mirror": (REFLECTING + REST, TILES + MIRROR, {}),
    "transparent background, linear light, one sample": (
        FLOOR + REST,
        "",
        {"alpha": True, "linear": True, "samples": 0},
    ),
}


def renderer_of(gl, name: str) -> tuple[Renderer, mujoco.MjData]:
    body, asset, options = SCENES[name]
    model = mujoco.MjModel.from_xml_string(f"<mujoco><asset>{asset}</asset><worldbody>{body}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return Renderer(gl, model, {model.geom("water").id: ball_surface("water")}, size=SIZE, **options), data


def drawn(renderer: Renderer, data: mujoco.MjData) -> list[np.ndarray]:
    """A frame, two through other points of the lens, as frames with depth of field are made, and what pixels show."""
    lenses = (0.0, 0.0), (0.1, 0.0), (-0.05, 0.08)
    eyes = [dataclasses.replace(FRONT.pose(), lens=lens, focal_distance=3.0) for lens in lenses]
    frames = [renderer.render(data, {}, eye, number) for number, eye in enumerate(eyes)]
    return [*frames, *renderer.surfaces(data, {}, FRONT)]


def assert_same(found: list[np.ndarray], expected: list[np.ndarray]) -> None:
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", SCENES)
def test_any_frame_is_as_the_first_whatever_was_in_memory_or_in_the_last(gl, name: str, monkeypatch):
    renderer, data = renderer_of(gl, name)
    with renderer:
        expected = drawn(renderer, data)
        assert_same(drawn(renderer, data), expected)
        # where something was, what is behind it shows as if it had never been there
        ball = 1
        data.geom_xpos[ball] += [0.7, 0.0, 0.3]
        assert (drawn(renderer, data)[0] != expected[0]).any()
        data.geom_xpos[ball] -= [0.7, 0.0, 0.3]
        assert_same(drawn(renderer, data), expected)
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
        renderer, data = renderer_of(gl, name)
        with renderer:
            assert_same(drawn(renderer, data), expected)


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
