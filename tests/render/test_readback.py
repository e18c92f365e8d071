"""Frames that come back late are the same frames: in their order, bit for bit, whatever is drawn meanwhile."""

import contextlib
import itertools
from pathlib import Path

import mujoco
import numpy as np
import pytest

from ripple_sim.render import Camera, Renderer
from ripple_sim.render.resources import Resources
from ripple_sim.render.targets import FrameFormat, Readback
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.solver import RippleError
from ripple_sim.solver.gl import GLContext, shared_context
from ripple_sim.video import render_video as rendering
from ripple_sim.video.film import Film
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.render_video import render_video

pytestmark = pytest.mark.usefixtures("opengl")

BALL = '<mujoco><worldbody><geom type="sphere" size="1" rgba="1 .5 .2 .6"/></worldbody></mujoco>'
MJCF = """<mujoco><option timestep="0.005"/><worldbody><geom name="egg" type="ellipsoid" size="0.3 0.25 0.2"/>
<geom type="plane" size="2 2 1" pos="0 0 -0.25"/>
<body name="stone" pos="0.05 0 0.3"><freejoint/><geom name="stone" size="0.05"/></body></worldbody></mujoco>"""
TOML = """model = "scene.xml"
duration = 0.4
[[ripple]]
geom = "egg"
resolution = 12
material = {speed = 0.3, density = 20.0}
"""


@pytest.fixture
def gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the driver pass for a GPU's, for which everything runs ahead."""
    monkeypatch.setattr(GLContext, "software", False)


def views(count: int) -> list[Camera]:
    return [Camera((0.0, 0.0, 0.0), 3.0, 90.0, 20.0 * number, 45.0) for number in range(count)]


@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize("driver", ["software", "gpu"])
def test_frames_come_back_in_order_however_many_are_on_their_way(
    request: pytest.FixtureRequest, driver: str, alpha: bool
) -> None:
    model = mujoco.MjModel.from_xml_string(BALL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = Renderer(shared_context(), model, {}, size=(70, 50), alpha=alpha)
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


def test_colours_are_divided_by_opacity() -> None:
    """All opacities, with all the colours that they leave room for."""
    opacity, color = np.tril_indices(256)
    pixels = np.stack([color, color // 2, 0 * color, opacity], axis=1).astype(np.uint8)
    gl = shared_context()
    with gl as ctx:
        picture = ctx.framebuffer([ctx.texture((257, 128), 4, pixels)])
    readback = Readback(Resources(gl, picture), FrameFormat(picture.size, alpha=True))
    readback.submit(picture)
    frame = readback.fetch()
    expected = 255 * pixels.astype(float) / np.maximum(opacity, 1)[:, None]
    got = frame[::-1].reshape(-1, 4)
    assert np.abs(got[:, :3] - expected[:, :3]).max() <= 0.501
    np.testing.assert_array_equal(got[:, 3], opacity)


@pytest.mark.parametrize("backend", ["cpu", "gl"])
@pytest.mark.parametrize("options", [{"overlay": ["height", "contacts"]}, {"compare": "paper"}, {"supersample": 2}])
@pytest.mark.usefixtures("gpu")
def test_a_video_is_the_same_whether_or_not_its_frames_are_drawn_ahead(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, backend: str, options: dict
) -> None:
    (tmp_path / "scene.xml").write_text(MJCF)
    (tmp_path / "scene.toml").write_text(TOML)
    scene = load_scene(tmp_path / "scene.toml")
    done: list[int] = []
    render_all = Film.render_all
    for order in ("ahead", "in turn"):
        if order == "in turn":
            monkeypatch.setattr(Film, "render_all", lambda self, shots, ahead: render_all(self, shots))
            monkeypatch.setattr(rendering, "Prefetch", lambda shots, waiting: contextlib.nullcontext(shots))
        render_video(
            scene,
            tmp_path / order,
            VideoOptions(size=(96, 64), fps=30, backend=backend, **options),
            progress=lambda frames, total: done.append(frames),
        )
    assert done == 2 * list(range(1, 13))
    for one, other in zip(*(sorted((tmp_path / order).iterdir()) for order in ("ahead", "in turn")), strict=True):
        assert one.read_bytes() == other.read_bytes()
