"""Interrupted videos: their finished parts are whole, and they continue to the same bytes."""

import json
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image
from programs import PROGRAMS
from unfinished_videos import contents, written_until_full

from ripple_sim.encode import FRAMES_IN_CLIP, FrameWriter, open_writer
from ripple_sim.encode.locks import locked
from ripple_sim.errors import VideoError

ENDINGS = [".mp4", ".webm", ".gif", ".webp", ""]
FRAMES = 2 * FRAMES_IN_CLIP + 10
SIZE = (64, 48)
FPS = 25
SETTINGS = {"the scene": "a moving square"}
DIGEST = "0123456789abcdef" * 2
PROGRAM_SETTINGS = {
    "endings": ENDINGS,
    "frames": FRAMES,
    "width": SIZE[0],
    "height": SIZE[1],
    "fps": FPS,
    "settings": SETTINGS,
}


def start(folder: Path) -> subprocess.Popen:
    process = subprocess.Popen(
        [sys.executable, PROGRAMS / "write_clips.py", folder, json.dumps(PROGRAM_SETTINGS)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def write(
    path: Path, first: int, last: int, settings: dict = SETTINGS, resume: bool = True
) -> FrameWriter:
    with open_writer(
        path, width=SIZE[0], height=SIZE[1], fps=FPS, settings=settings, resume=resume
    ) as writer:
        for number in range(first, last):
            writer.write(np.full((SIZE[1], SIZE[0], 3), number, np.uint8))
        if last < FRAMES:
            raise KeyboardInterrupt
    return writer


@pytest.fixture
def interrupted(tmp_path) -> Path:
    path = tmp_path / "clip.mp4"
    with pytest.raises(KeyboardInterrupt):
        write(path, 0, 60)
    return path


def test_killed_again_and_again_videos_become_the_same_bytes(tmp_path):
    whole = tmp_path / "whole"
    broken = tmp_path / "broken"
    begun = time.perf_counter()
    assert start(whole).wait() == 0
    longest = (time.perf_counter() - begun) / 6
    chance = random.Random(6)
    kills = 0
    for _ in range(10):
        process = start(broken)
        time.sleep(chance.uniform(0, longest))
        process.send_signal(signal.SIGKILL)
        killed = process.wait() == -signal.SIGKILL
        kills += killed
        longest /= 1 if killed else 2  # it was done: the machine had more to do in the first run
        for clip in broken.glob("*.part/frames/[!.]*"):  # what is left plays
            if clip.suffix in (".mp4", ".webm", ".mkv"):
                with av.open(str(clip)) as container:
                    assert sum(1 for _ in container.decode(video=0)) in (
                        FRAMES_IN_CLIP,
                        FRAMES % FRAMES_IN_CLIP,
                    )
            else:
                with Image.open(clip) as image:
                    image.load()
    assert start(broken).wait() == 0
    assert kills > 3
    assert contents(broken) == contents(whole)
    assert sorted(path.name for path in broken.iterdir()) == sorted(
        f"clip{ending}" for ending in ENDINGS
    )


def test_an_interrupted_video_names_the_kept_files(tmp_path):
    with pytest.raises(KeyboardInterrupt) as ending:
        write(tmp_path / "clip.mp4", 0, 60)
    part = tmp_path / "clip.mp4.part"
    assert ending.value.__notes__ == [
        f"{FRAMES_IN_CLIP} frames are kept in {part}; --resume carries on from there"
    ]
    assert [path.name for path in (part / "frames").iterdir()] == ["frames_00000-00047.mp4"]


def test_a_video_without_a_whole_clip_leaves_nothing(tmp_path):
    with pytest.raises(KeyboardInterrupt) as ending:
        write(tmp_path / "clip.mp4", 0, FRAMES_IN_CLIP - 1)
    assert not hasattr(ending.value, "__notes__")
    assert list(tmp_path.iterdir()) == []


def test_without_resume_a_video_starts_anew(interrupted):
    assert write(interrupted, 0, FRAMES, resume=False).frames == FRAMES
    assert list(interrupted.parent.iterdir()) == [interrupted]


def test_a_video_with_an_incomplete_part_folder_is_rendered_from_the_start(interrupted):
    """A kill at the very end leaves settings without frames."""
    shutil.rmtree(interrupted.with_name("clip.mp4.part") / "frames")
    assert write(interrupted, 0, FRAMES).frames == FRAMES
    assert list(interrupted.parent.iterdir()) == [interrupted]


def test_resuming_with_other_settings_is_refused_and_harms_nothing(interrupted):
    before = contents(interrupted.parent)
    with pytest.raises(
        VideoError, match=r"the scene was a moving square and now is a ball; .* leave --resume out"
    ):
        write(interrupted, 48, FRAMES, settings={"the scene": "a ball"})
    with pytest.raises(VideoError, match="the length was None and now is 3"):
        write(interrupted, 48, FRAMES, settings={**SETTINGS, "the length": 3})
    assert contents(interrupted.parent) == before


def test_resuming_a_different_simulation_is_refused_and_keeps_the_files(tmp_path):
    path = tmp_path / "clip.mp4"

    def go(digest: str) -> None:
        with open_writer(
            path, width=SIZE[0], height=SIZE[1], fps=FPS, settings=SETTINGS, resume=True
        ) as writer:
            writer.check_state(0, DIGEST)
            writer.check_state(16, digest)
            for _ in range(writer.frames, 60):
                writer.write(np.zeros((SIZE[1], SIZE[0], 3), np.uint8))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        go(DIGEST)
    with (path.with_name("clip.mp4.part") / "states.txt").open("a") as file:
        file.write("32 0123")  # cut off by a kill
    with pytest.raises(
        VideoError, match="at frame 16 the simulation is not in the state it was in before"
    ):
        go(DIGEST[::-1])
    with pytest.raises(KeyboardInterrupt):
        go(DIGEST)
    assert (path.with_name("clip.mp4.part") / "frames" / "frames_00000-00047.mp4").exists()


def test_two_processes_do_not_write_the_same_video(interrupted):
    with (
        locked(interrupted.with_name("clip.mp4.part") / ".lock"),
        pytest.raises(VideoError, match="another process is writing"),
    ):
        write(interrupted, 48, FRAMES)
    assert write(interrupted, 48, FRAMES).frames == FRAMES


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_full_disk_is_one_line_and_leaves_nothing_broken(tmp_path, ending):
    path = tmp_path / f"clip{ending}"
    said = written_until_full(path, 20_000, 160, 90, 60, settings=SETTINGS)
    assert said.startswith(f"cannot write the video {path}: ")
    assert "File too large" in said and said.count("\n") == 1
    left = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert all(
        path.name in ("settings.json", "states.txt") or path.name.startswith("frame")
        for path in left
    )
