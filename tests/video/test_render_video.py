"""Interrupted renders go on to the same video or say why not; passes; a stage that runs ahead."""

import dataclasses
import json
import re
import threading
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from PIL import Image
from programs import PROGRAMS, ended
from unfinished_videos import MJCF, contents, egg_scene, interrupting_at

from ripple_sim import ExportOptions, Simulation, export_scene, render_video
from ripple_sim.encode import FRAMES_IN_CLIP
from ripple_sim.errors import ExportError, SceneError, VideoError
from ripple_sim.scene import MaterialEntry, Scene, load_scene
from ripple_sim.solver.gl import GLContext
from ripple_sim.video import VideoOptions, prefetched

OPTIONS = {"size": (64, 48), "fps": 30}


@pytest.mark.parametrize("name", ["clip.mp4", "frames"])
def test_a_resumed_render_makes_the_same_video(scene, tmp_path, name):
    whole = tmp_path / "whole" / name
    broken = tmp_path / "broken" / name
    # with sound, which is heard from where the camera is at each frame
    scene = dataclasses.replace(scene, camera=msgspec.structs.replace(scene.camera, orbit=90.0))
    options = {**OPTIONS, "sound": name == "clip.mp4"}
    assert render_video(scene, whole, VideoOptions(**options)).resumed_at == 0
    for frame in (20, 58):
        with pytest.raises(KeyboardInterrupt):
            render_video(
                scene, broken, VideoOptions(resume=True, **options), progress=interrupting_at(frame)
            )
    summary = render_video(scene, broken, VideoOptions(resume=True, **options))
    # frames that wait to be encoded are lost
    assert (
        summary.resumed_at == FRAMES_IN_CLIP
        if name == "clip.mp4"
        else 48 <= summary.resumed_at <= 58
    )
    assert contents(broken.parent) == contents(whole.parent)


def test_warning_about_invisible_waves_names_a_density_that_shows_them(scene, tmp_path):
    def rendered(density: float, **options: object) -> list[str]:
        target = msgspec.structs.replace(
            scene.targets[0], material=MaterialEntry(density=density, stiffness=1e3)
        )
        changed = dataclasses.replace(scene, targets=(target,))
        with warnings.catch_warnings(record=True, action="always") as told:
            render_video(
                changed, tmp_path / "frames", VideoOptions(**OPTIONS, overwrite=True, **options)
            )
        return [str(each.message) for each in told if "higher than a pixel" in str(each.message)]

    [message] = rendered(1e6)
    density = float(re.search(r"lower, ([^ ]+) kg/m", message)[1])
    assert not rendered(density)
    assert not rendered(1e6, overlay=["height"]), "colours show them"


@pytest.mark.parametrize(
    ("beside", "duration", "lines"), [(0.0, None, 0), (5.0, None, 1), (5.0, 0.3, 0)]
)
def test_warning_about_a_target_that_nothing_touches_in_the_whole_scene(
    tmp_path, opengl, beside, duration, lines
):
    egg_scene(tmp_path, duration=0.5)
    text = (tmp_path / "scene.xml").read_text()
    (tmp_path / "scene.xml").write_text(
        text.replace('pos="0.05 0 0.3"', f'pos="{0.05 + beside} 0 0.3"')
    )
    scene = load_scene(tmp_path / "scene.toml")
    options = VideoOptions(**OPTIONS, duration=duration)
    with warnings.catch_warnings(record=True, action="always") as told:
        render_video(scene, tmp_path / "frames", options)
    assert ["no wave on 'egg': nothing touched it" in str(each.message) for each in told] == [
        True
    ] * lines


def test_a_render_of_a_changed_scene_or_with_other_options_is_not_resumed(scene, tmp_path):
    def resume(scene: Scene, **options: object) -> None:
        settings = VideoOptions(resume=True, **{**OPTIONS, **options})
        render_video(scene, tmp_path / "frames", settings, progress=interrupting_at(20))

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
    options = VideoOptions(resume=True, **OPTIONS)

    def push(simulation: Simulation) -> None:
        simulation.data.qvel[0] += 1e-9

    with pytest.raises(VideoError, match="at frame 16 the simulation is not in the state"):
        render_video(scene, tmp_path / "frames", options, on_step=push)
    assert (
        json.loads((tmp_path / "frames.part" / "settings.json").read_text())["the size"] == "64x48"
    )


@pytest.mark.parametrize("ahead", [False, True])
def test_a_lost_context_is_one_line_and_the_frames_stay(scene, tmp_path, ahead):
    driver = "hardware" if ahead else "software"
    program = PROGRAMS / "render_until_context_is_lost.py"
    result = ended(program, driver, tmp_path / "scene.toml", "-o", tmp_path / "frames")
    assert result.returncode == 1
    lines = [
        line
        for line in result.stderr.splitlines()
        if "nanobind" not in line and not line.startswith(" - ")
    ]
    said = (
        r"ripple-sim: the OpenGL context .* is lost; .* frames are kept in .*; --resume carries on"
    )
    assert len(lines) == 1 and re.match(said, lines[0]), result.stderr
    options = VideoOptions(resume=True, **OPTIONS, backend="cpu", duration=0.6)
    # frames that still wait to be encoded are lost
    assert render_video(scene, tmp_path / "frames", options).resumed_at > 8


def test_a_video_is_the_same_if_waves_on_a_gpu_run_during_drawing(scene, tmp_path, monkeypatch):
    """A software driver taken for hardware: two threads share its context, two frames wait."""
    threads: set[str] = set()
    for hardware in (False, True):
        threads.clear()
        monkeypatch.setattr(GLContext, "software", not hardware)
        options = VideoOptions(**OPTIONS, duration=0.2, backend="gl")
        folder = tmp_path / f"frames {hardware}"
        render_video(
            scene, folder, options, on_step=lambda _: threads.add(threading.current_thread().name)
        )
        assert threads == {"simulation_0" if hardware else "MainThread"}
    host, device = (
        np.array(
            [
                np.asarray(Image.open(path), int)
                for path in sorted((tmp_path / f"frames {hardware}").iterdir())
            ]
        )
        for hardware in (False, True)
    )
    assert len(host) == 6
    assert np.abs(host - device).max() <= 1


def test_a_stage_runs_ahead_in_its_thread_up_to_its_limit():
    begun: list[int] = []
    threads = set()
    taken = []
    before = threading.active_count()

    def items() -> Iterator[int]:
        for number in range(50):
            begun.append(number)
            threads.add(threading.get_ident())
            yield number

    with prefetched(items(), 3) as ahead:
        for number in ahead:
            taken.append(number)
            waited = time.monotonic() + 60
            # one is in the taker's hands, three wait, one is held until there is room
            while len(begun) < min(number + 5, 50) and time.monotonic() < waited:
                time.sleep(0.001)
            assert len(begun) == min(number + 5, 50)
    assert taken == begun == list(range(50))
    assert len(threads - {threading.get_ident()}) == len(threads) == 1
    begun.clear()
    with prefetched(items(), 3) as ahead:  # leaving early stops the thread
        assert next(ahead) == 0
    assert threading.active_count() == before


def test_an_error_is_raised_in_place_of_the_next_item():
    def items() -> Iterator[int]:
        yield 1
        yield 2
        raise ZeroDivisionError

    taken = []
    with pytest.raises(ZeroDivisionError), prefetched(items(), 3) as ahead:
        for number in ahead:
            taken.append(number)
    assert taken == [1, 2]


def test_every_frame_has_its_passes_with_any_number_of_exposures(
    scene: Scene, tmp_path: Path
) -> None:
    options = {"size": (32, 24), "fps": 20, "duration": 0.2}
    blur = {"shutter": 180.0, "exposures": 2}
    passes = ("depth", "flow")
    render_video(
        scene, tmp_path / "clip.mp4", VideoOptions(**options, **blur, supersample=2, passes=passes)
    )
    files = sorted((tmp_path / "clip.passes").glob("*.npz"))
    assert [each.name for each in files] == [f"passes_{frame:05d}.npz" for frame in range(4)]
    _, second, _, last = map(np.load, files)
    assert second["depth"].shape == (24, 32)
    assert np.abs(second["flow"]).max() > 0  # the stone falls
    assert not last["flow"].any()


def test_a_resumed_render_has_the_passes_of_one_that_was_not_interrupted(
    scene: Scene, tmp_path: Path
) -> None:
    options = VideoOptions(size=(32, 24), fps=20, duration=0.4, passes=("depth", "flow"))
    render_video(scene, tmp_path / "whole", options)

    def interrupt(done: int, _: int) -> None:
        if done == 6:
            for _ in range(500):  # another thread writes the frames
                if len(list((tmp_path / "clip.part").rglob("frame_*.png"))) >= 4:
                    break
                time.sleep(0.01)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render_video(scene, tmp_path / "clip", options, progress=interrupt)
    for lost in (2, 3):  # the passes come after the frames; these came too late
        (tmp_path / "clip.passes" / f"passes_{lost:05d}.npz").unlink(missing_ok=True)
    with pytest.raises(VideoError, match="the passes was depth,flow in npz and now is None"):
        render_video(scene, tmp_path / "clip", dataclasses.replace(options, resume=True, passes=()))
    summary = render_video(scene, tmp_path / "clip", dataclasses.replace(options, resume=True))
    assert summary.resumed_at >= 4
    whole, resumed = (contents(tmp_path / f"{name}.passes") for name in ("whole", "clip"))
    # which names its video
    assert whole.pop("segmentation.json") != resumed.pop("segmentation.json")
    assert len(whole) == 8 and resumed == whole


def test_passes_of_another_video_are_not_replaced(scene: Scene, tmp_path: Path) -> None:
    options = VideoOptions(size=(32, 24), fps=20, duration=0.1, passes=("depth",))
    render_video(scene, tmp_path / "clip.mp4", options)
    with pytest.raises(VideoError, match=r"those of clip\.mp4"):
        render_video(scene, tmp_path / "clip.webm", options)
    assert not (tmp_path / "clip.webm").exists()
    render_video(scene, tmp_path / "clip.mp4", options)
    before = contents(tmp_path)

    def fail(simulation: object) -> None:
        raise KeyboardInterrupt

    # a render that fails without a frame leaves all as it was
    for name in ("clip.mp4", "other.mp4"):
        with pytest.raises(KeyboardInterrupt):
            render_video(scene, tmp_path / name, options, on_frame=fail)
    assert contents(tmp_path) == before
    render_video(scene, tmp_path / "clip.webm", dataclasses.replace(options, overwrite=True))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"supersample": 0}, "supersample must be a whole number, 1 or greater, got 0"),
        ({"size": None}, "size must be (int, int), got None"),
        ({"size": "64x36"}, "size must be (int, int), got '64x36'"),
        (
            {"size": (0, 0)},
            "size must be (width, height) in pixels, two whole numbers greater than 0, got (0, 0)",
        ),
        ({"fps": 0}, "fps must be a whole number, 1 or greater, got 0"),
        ({"fps": np.nan}, "fps must be int"),
        ({"duration": -1.0}, "duration must be a finite number greater than 0, got -1.0"),
        ({"slow_motion": np.nan}, "slow motion must be a finite number greater than 0, got nan"),
        ({"shutter": 400.0}, "shutter must be 0 to 360 degrees, got 400.0"),
        ({"aperture": np.inf}, "aperture must be 0 m or more, got inf"),
        ({"duration": "x"}, "duration must be float or None, got 'x'"),
        ({"overlay": [3]}, "overlay must be a list of str or None, got [3]"),
        ({"resolution": "x"}, "resolution must be int or None, got 'x'"),
        ({"frame_format": b"z"}, "frame format must be 'png' or 'exr', got b'z'"),
        ({"resume": np.zeros(2)}, "resume must be bool, got array([0., 0.])"),
        ({"device": -1}, "device must be a whole number, 0 or greater, got -1"),
    ],
)
def test_options_are_checked_where_they_are_made(given: dict[str, Any], message: str) -> None:
    with pytest.raises(VideoError, match=f"^{re.escape(message)}"):
        VideoOptions(**given)
    if set(given) & {"size", "fps", "duration", "slow_motion", "resolution"}:
        with pytest.raises(ExportError, match=f"^{re.escape(message)}"):
            ExportOptions(**given)


def test_a_camera_that_the_model_lacks_is_refused_before_anything_is_written(
    scene: Scene, tmp_path: Path
) -> None:
    with pytest.raises(SceneError, match="no camera 'ear'"):
        render_video(scene, tmp_path / "clip.mp4", VideoOptions(camera="ear"))
    with pytest.raises(SceneError, match="no camera 'ear'"):
        export_scene(scene, tmp_path / "clip.html", ExportOptions(camera="ear"))
    assert not list(tmp_path.glob("clip*"))


@pytest.mark.parametrize("name", ["progress", "on_step", "on_frame"])
def test_callbacks_must_be_functions(scene: Scene, tmp_path: Path, name: str) -> None:
    with pytest.raises(
        VideoError, match=f"^{name.replace('_', ' ')} must be a function, or None, got 3$"
    ):
        options = VideoOptions()
        render_video(scene, tmp_path / "o.mp4", options, **{name: 3})  # type: ignore[arg-type]


def rings_alone(scene: Scene, tmp_path: Path, **changes: object) -> list[str]:
    """Warnings of low waves on an egg whose dent is higher than a pixel, and whose ring is not."""
    material = MaterialEntry(speed=0.5, density=60.0, stiffness=5e3, damping=30.0)
    target = msgspec.structs.replace(scene.targets[0], material=material, **changes)
    with warnings.catch_warnings(record=True, action="always") as told:
        render_video(
            dataclasses.replace(scene, targets=(target,)),
            tmp_path / "frames",
            VideoOptions(**OPTIONS, overwrite=True),
        )
    return [str(each.message) for each in told if "higher than a pixel" in str(each.message)]


def test_warning_about_a_ring_lower_than_a_pixel_despite_a_visible_dent(
    scene: Scene, tmp_path: Path
) -> None:
    [message] = rings_alone(scene, tmp_path)
    assert "0.0002" in message  # m; the dent is a hundred times as deep
    assert not rings_alone(scene, tmp_path, limit=False, warn=False), "it is for the ear"
