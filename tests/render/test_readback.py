"""Frames that are read back late are the same, bit for bit, and in order."""

import contextlib
import dataclasses
import itertools
from pathlib import Path
from typing import Any

import moderngl
import mujoco
import numpy as np
import pytest
from drawn import BALL, FLOOR, FRONT, SIZE, ball_surface, posed
from unfinished_videos import egg_scene

from ripple_sim.render import Camera, FrameFormat, Readback, Renderer, Resources
from ripple_sim.solver import RippleError
from ripple_sim.solver.gl import GLContext
from ripple_sim.video import Film, VideoOptions, render_video as rendering
from ripple_sim.video.render_video import render_video

TILES = (
    '<texture name="tiles" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".1 .2 .3" '
    'width="8" height="8"/>'
)
MIRROR = '<material name="floor" texture="tiles" texrepeat="5 5" reflectance=".4"/>'
REFLECTING = FLOOR.replace("rgba=", 'material="floor" rgba=')
GLASS = '<geom type="box" size=".4 .05 .4" pos=".2 -.6 .5" rgba=".2 .4 .8 .4"/>'
WATER = '<geom name="water" type="sphere" size=".5" pos="-.6 0 .6"/>'
# lit by the studio's single light, whose shaders are the quickest to compile
REST = BALL + GLASS + WATER

LONE_BALL = (
    '<mujoco><worldbody><geom type="sphere" size="1" rgba="1 .5 .2 .6"/></worldbody></mujoco>'
)


# every pass, every format of a frame, and the background both at once and from a coarse one
@dataclasses.dataclass
class DrawnScene:
    body: str
    asset: str = ""
    options: dict[str, Any] = dataclasses.field(default_factory=dict)  # of the renderer


SCENES = {
    "smooth background": DrawnScene(FLOOR + REST),
    "mirror": DrawnScene(REFLECTING + REST, TILES + MIRROR),
    "transparent, linear, one sample": DrawnScene(
        FLOOR + REST, options={"alpha": True, "linear": True, "samples": 0}
    ),
}


def renderer_of(gl, name: str) -> tuple[Renderer, mujoco.MjData]:
    scene = SCENES[name]
    model, data = posed(
        f"<mujoco><asset>{scene.asset}</asset><worldbody>{scene.body}</worldbody></mujoco>"
    )
    targets = {model.geom("water").id: ball_surface("water")}
    return Renderer(gl, model, targets, size=SIZE, **scene.options), data


def drawn(renderer: Renderer, data: mujoco.MjData) -> list[np.ndarray]:
    """A frame, two frames through other points of the lens, and what their pixels show."""
    lenses = (0.0, 0.0), (0.1, 0.0), (-0.05, 0.08)
    eyes = [dataclasses.replace(FRONT.pose(), lens=lens, focal_distance=3.0) for lens in lenses]
    frames = [renderer.render(data, {}, eye, number) for number, eye in enumerate(eyes)]
    return [*frames, *renderer.surfaces(data, {}, FRONT)]


def assert_same(found: list[np.ndarray], expected: list[np.ndarray]) -> None:
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", SCENES)
def test_frames_do_not_depend_on_earlier_frames(gl, name: str, monkeypatch):
    renderer, data = renderer_of(gl, name)
    with renderer:
        expected = drawn(renderer, data)
        assert_same(drawn(renderer, data), expected)
        # a ball that has moved away and back leaves no trace
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
                # textures and the like have their content as the third argument
                if isinstance(made, moderngl.Buffer) or len(arguments) < 3:
                    with gl as ctx:
                        fill(ctx, made, depth, "reserve" in options)
                return made

            return created

        monkeypatch.setattr(Resources, "__getattr__", create_filled)
        renderer, data = renderer_of(gl, name)
        with renderer:
            assert_same(drawn(renderer, data), expected)


def fill(ctx: moderngl.Context, made: Any, depth: float, empty: bool) -> None:
    """Fill buffers made without contents with NaN, so that a read shows."""
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


@pytest.fixture
def gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the driver pass for a GPU's, for which everything runs ahead."""
    monkeypatch.setattr(GLContext, "software", False)


def views(count: int) -> list[Camera]:
    return [Camera((0.0, 0.0, 0.0), 3.0, 90.0, 20.0 * number, 45.0) for number in range(count)]


@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize("driver", ["software", "gpu"])
def test_frames_come_back_in_order_however_many_are_on_their_way(
    gl, request, driver: str, alpha: bool
) -> None:
    model, data = posed(LONE_BALL)
    renderer = Renderer(gl, model, {}, size=(70, 50), alpha=alpha)
    expected = [renderer.render(data, {}, camera) for camera in views(5)]
    assert all((a != b).any() for a, b in itertools.pairwise(expected))
    if driver == "gpu":
        request.getfixturevalue("gpu")
    got = []
    for number, camera in enumerate(views(5)):
        renderer.submit(data, {}, camera)
        if number > 2:
            got.append(renderer.fetch())
    got += [renderer.fetch() for _ in range(3)]
    np.testing.assert_array_equal(got, expected)
    with pytest.raises(RippleError, match="no frame is on its way"):
        renderer.fetch()


def test_colours_are_divided_by_opacity(gl) -> None:
    """All opacities, with all the colours that they leave room for."""
    opacity, color = np.tril_indices(256)
    pixels = np.stack([color, color // 2, 0 * color, opacity], axis=1).astype(np.uint8)
    with gl as ctx:
        picture = ctx.framebuffer([ctx.texture((257, 128), 4, pixels)])
    readback = Readback(Resources(gl, picture), FrameFormat(picture.size, alpha=True))
    readback.submit(picture)
    frame = readback.fetch()
    expected = 255 * pixels.astype(float) / np.maximum(opacity, 1)[:, None]
    got = frame[::-1].reshape(-1, 4)
    assert np.abs(got[:, :3] - expected[:, :3]).max() <= 0.501  # rounded to a code
    np.testing.assert_array_equal(got[:, 3], opacity)


@pytest.mark.parametrize("backend", ["cpu", "gl"])
@pytest.mark.parametrize(
    "options", [{"overlay": ["height", "contacts"], "compare": "paper"}, {"supersample": 2}]
)
@pytest.mark.usefixtures("gl", "gpu")
def test_a_video_is_the_same_whether_or_not_its_frames_are_drawn_ahead(
    tmp_path, monkeypatch, request, backend, options
):
    if backend == "gl":
        request.getfixturevalue("computes")
    scene = egg_scene(
        tmp_path, '<geom type="plane" size="2 2 1" pos="0 0 -0.25"/>', duration=0.4, density=20.0
    )
    finished: list[int] = []
    asked = VideoOptions(size=(64, 48), fps=30, backend=backend, **options)

    def render(folder: str) -> list[Path]:
        render_video(
            scene, tmp_path / folder, asked, progress=lambda frames, _: finished.append(frames)
        )
        return sorted((tmp_path / folder).iterdir())

    drawn_ahead = render("ahead")
    render_all = Film.render_all
    monkeypatch.setattr(Film, "render_all", lambda self, shots, ahead: render_all(self, shots))
    monkeypatch.setattr(
        rendering, "prefetched", lambda shots, waiting: contextlib.nullcontext(shots)
    )
    drawn_in_turn = render("in turn")
    assert finished == 2 * list(range(1, 13))
    for one, other in zip(drawn_ahead, drawn_in_turn, strict=True):
        assert one.read_bytes() == other.read_bytes()
