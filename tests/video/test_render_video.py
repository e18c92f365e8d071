"""Interrupted renders go on to the same video, or say why not.

A stage that runs ahead: the same items in the same order, no more of them than may wait, and its errors.
"""

import json
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest
from PIL import Image
from unfinished_videos import MJCF, contents

from ripple_sim.encode.output import FRAMES_IN_CLIP
from ripple_sim.errors import VideoError
from ripple_sim.scene.load_scene import load_scene
from ripple_sim.scene.scene import Scene
from ripple_sim.solver.gl import GLContext
from ripple_sim.video.options import VideoOptions
from ripple_sim.video.render_video import Prefetch, render_video

OPTIONS = {"size": (64, 48), "fps": 30}


class Impatience:
    """Interrupts at a frame."""

    def __init__(self, frame: int) -> None:
        self._frame = frame

    def __call__(self, done: int, total: int) -> None:
        if done == self._frame:
            raise KeyboardInterrupt


def _push(simulation) -> None:
    simulation.data.qvel[0] += 1e-9


@pytest.mark.parametrize("name", ["clip.mp4", "frames"])
def test_a_render_goes_on_to_the_same_video(scene, tmp_path, name):
    whole, broken = tmp_path / "whole" / name, tmp_path / "broken" / name
    assert render_video(scene, whole, VideoOptions(**OPTIONS)).resumed_at == 0
    for frame in (20, 58):
        with pytest.raises(KeyboardInterrupt):
            render_video(scene, broken, VideoOptions(resume=True, **OPTIONS), progress=Impatience(frame))
    summary = render_video(scene, broken, VideoOptions(resume=True, **OPTIONS))
    # frames that wait to be encoded are lost
    assert summary.resumed_at == FRAMES_IN_CLIP if name == "clip.mp4" else 48 <= summary.resumed_at <= 58
    assert contents(broken.parent) == contents(whole.parent)


def test_a_render_of_a_changed_scene_or_with_other_options_is_not_resumed(scene, tmp_path):
    def resume(scene: Scene, **options: object) -> None:
        render_video(
            scene, tmp_path / "frames", VideoOptions(resume=True, **{**OPTIONS, **options}), progress=Impatience(20)
        )

    with pytest.raises(KeyboardInterrupt):
        resume(scene)
    with pytest.raises(VideoError, match="the size was 64x48 and now is 96x48"):
        resume(scene, size=(96, 48))
    with pytest.raises(VideoError, match="the number of frames was 60 and now is 30"):
        resume(scene, duration=1.0)
    (tmp_path / "scene.xml").write_text(MJCF.replace('size="0.05"', 'size="0.06"'))
    with pytest.raises(VideoError, match="the scene's fingerprint was"):
        resume(load_scene(tmp_path / "scene.toml"))
    (tmp_path / "scene.xml").write_text(MJCF)
    with pytest.raises(VideoError, match="at frame 16 the simulation is not in the state"):
        render_video(scene, tmp_path / "frames", VideoOptions(resume=True, **OPTIONS), on_step=_push)
    assert json.loads((tmp_path / "frames.part" / "settings.json").read_text())["the size"] == "64x48"


@pytest.mark.parametrize("ahead", [False, True])
def test_a_lost_context_is_one_line_and_the_frames_stay(scene, tmp_path, ahead):
    program = (
        "import ctypes, sys\n"
        "from ripple_sim.cli import main as cli\n"
        "from ripple_sim.solver.gl import GLContext, shared_context\n"
        + "GLContext.software = False\n"
        * ahead  # a frame is on its way back when it happens
        + "def lose(done, total):\n"
        "    if done == 20:\n"
        "        egl = ctypes.CDLL('libEGL.so.1')\n"
        "        egl.eglGetCurrentDisplay.restype = ctypes.c_void_p\n"
        "        with shared_context():\n"
        "            egl.eglTerminate(ctypes.c_void_p(egl.eglGetCurrentDisplay()))\n"
        "from ripple_sim.video import render_video as module\n"
        "render = module.render_video\n"
        "module.render_video = lambda *args, **others: render(*args, **{**others, 'progress': lose})\n"
        "sys.exit(cli.main(['render', *sys.argv[1:], '--size', '64x48', '--fps', '30', '--backend', 'cpu']))\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", program, tmp_path / "scene.toml", "-o", tmp_path / "frames"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 1
    lines = [line for line in result.stderr.splitlines() if "nanobind" not in line and not line.startswith(" - ")]
    assert len(lines) == 1, result.stderr
    assert re.match(
        r"ripple-sim: the OpenGL context .* is lost; .* frames are kept in .*; --resume carries on", lines[0]
    )
    assert render_video(scene, tmp_path / "frames", VideoOptions(resume=True, **OPTIONS, backend="cpu")).resumed_at > 8


def test_waves_on_a_gpu_run_beside_the_drawing_and_the_video_is_the_same(scene, tmp_path, monkeypatch):
    """The software driver taken for hardware: two threads share its context, and two frames are on their way."""
    threads = set()
    for hardware in (False, True):
        monkeypatch.setattr(GLContext, "software", not hardware)
        seen = set()
        render_video(
            scene,
            tmp_path / f"{hardware}" / "frames",
            VideoOptions(**{**OPTIONS, "duration": 0.2}, backend="gl"),
            on_step=lambda simulation, seen=seen: seen.add(threading.current_thread().name),
        )
        threads.add((hardware, *seen))
    assert threads == {(False, "MainThread"), (True, "simulation")}
    host, device = (
        [np.asarray(Image.open(path), int) for path in sorted((tmp_path / f"{hardware}" / "frames").glob("*.png"))]
        for hardware in (False, True)
    )
    assert len(host) == len(device) == 6
    assert max(np.abs(a - b).max() for a, b in zip(host, device, strict=True)) <= 1


def test_items_come_in_order_from_another_thread():
    threads = set()

    def items() -> Iterator[int]:
        for number in range(50):
            threads.add(threading.get_ident())
            yield number

    with Prefetch(items(), 3) as prefetched:
        assert list(prefetched) == list(range(50))
    assert len(threads) == 1
    assert threading.get_ident() not in threads


def test_it_runs_ahead_as_far_as_it_may_and_no_further():
    begun: list[int] = []

    def items() -> Iterator[int]:
        for number in range(50):
            begun.append(number)
            yield number

    with Prefetch(items(), 3) as prefetched:
        for number in prefetched:
            waited = time.monotonic() + 60
            # one is in the taker's hands, three wait, one is held until there is room
            while len(begun) < min(number + 5, 50) and time.monotonic() < waited:
                time.sleep(0.001)
            assert len(begun) == min(number + 5, 50)


def test_an_error_comes_where_the_next_item_would_have_come():
    def items() -> Iterator[int]:
        yield 1
        yield 2
        raise ZeroDivisionError

    taken = []
    with pytest.raises(ZeroDivisionError), Prefetch(items(), 3) as prefetched:
        for number in prefetched:
            taken.append(number)
    assert taken == [1, 2]


def test_leaving_early_stops_the_thread():
    def items() -> Iterator[int]:
        number = 0
        while True:
            yield number
            number += 1

    before = threading.active_count()
    with Prefetch(items(), 3) as prefetched:
        assert next(prefetched) == 0
    assert threading.active_count() == before
