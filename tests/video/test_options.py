"""Options of a video: defaults by scene and output, refusals, and the number of frames."""

import dataclasses
import importlib.resources
import shutil
from pathlib import Path

import msgspec
import mujoco
import pytest

from ripple_sim.errors import RippleError, SceneError
from ripple_sim.scene import (
    MAX_DURATION,
    MAX_SLOW_MOTION,
    CameraEntry,
    HeightEntry,
    InsideEntry,
    MapEntry,
    MaterialEntry,
    RippleEntry,
    Scene,
    load_scene,
)
from ripple_sim.video import VideoOptions, check_options, frame_count, scene_digest, settled

SCENES = Path(str(importlib.resources.files("ripple_sim.scenes")))
MJCF = '<mujoco><worldbody><geom name="egg" size="{}"/></worldbody></mujoco>'


def made(size: float = 0.3, **fields: object) -> Scene:
    entry = RippleEntry(geom="egg", material=MaterialEntry())
    standard = {"name": "egg", "targets": (entry,), "camera": CameraEntry(), "duration": 2.5}
    return Scene(model=mujoco.MjModel.from_xml_string(MJCF.format(size)), **(standard | fields))


def test_none_is_left_to_the_scene_and_to_the_output() -> None:
    scene = made(overlay=("time", "contacts"))
    options = settled(VideoOptions(), scene, Path("clip.gif"))
    assert (options.fps, options.duration, options.overlay) == (25, 2.5, ("time", "contacts"))
    assert options.backend in ("gl", "cpu")
    # nothing is left to settle
    assert settled(options, made(duration=9.0), Path("clip.mp4")) == options


@pytest.mark.parametrize(
    ("duration", "fps", "slow_motion", "frames"),
    [
        (2.0, 60, 1.0, 120),
        (2.0, 60, 4.0, 480),
        (2.0, 60, 0.5, 60),
        (0.1, 24, 1.0, 2),
        (1e-6, 60, 1.0, 1),
        (1, 1, 1, 1),
    ],
)
def test_frames_fill_the_duration(
    duration: float, fps: int, slow_motion: float, frames: int
) -> None:
    options = VideoOptions(duration=duration, fps=fps, slow_motion=slow_motion)
    assert frame_count(options) == frames
    assert options.rate == fps * slow_motion


@pytest.mark.parametrize(
    ("name", "valid", "values"),
    [
        ("duration", "less than 86400", (MAX_DURATION, 1e9)),
        ("slow_motion", "up to 1000", (MAX_SLOW_MOTION + 1, 1e6)),
    ],
)
def test_a_duration_or_slow_motion_out_of_range_is_named(
    name: str, valid: str, values: tuple[float, float]
) -> None:
    for value in values:
        message = f"{name.replace('_', ' ')} must be a positive number,? {valid}.*, got {value!r}"
        with pytest.raises(SceneError, match=message):
            frame_count(VideoOptions(**{"duration": 1.0, "fps": 60, name: value}))
    assert frame_count(VideoOptions(duration=0.1, fps=10, slow_motion=MAX_SLOW_MOTION)) == 1000


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"overlay": ["hight"]}, "there is no overlay 'hight'"),
        ({"compare": "fem"}, "operator to compare with must be one of .*, got 'fem'"),
        ({"transparent": True}, "cannot be transparent"),
        ({"frame_format": "exr"}, "name a folder"),
    ],
)
def test_a_refused_video_leaves_nothing(tmp_path: Path, options: dict, said: str) -> None:
    with pytest.raises(RippleError, match=said):
        check_options(VideoOptions(**options), tmp_path / "clip.mp4")
    check_options(VideoOptions(), tmp_path / "clip.mp4")
    assert list(tmp_path.iterdir()) == []


def test_the_fingerprint_of_a_scene_does_not_depend_on_name_and_length() -> None:
    digest = scene_digest(made())
    assert len(digest) == 16
    assert int(digest, 16) >= 0
    assert scene_digest(made(name="other", duration=9.0, overlay=("time",))) == digest


@pytest.mark.parametrize("name", ["face", "skull"])
def test_a_scene_in_another_folder_has_the_same_fingerprint(tmp_path: Path, name: str) -> None:
    copy = shutil.copytree(
        SCENES, tmp_path / "a longer folder", ignore=shutil.ignore_patterns("*.py*")
    )
    assert scene_digest(load_scene(copy / f"{name}.toml")) == scene_digest(
        load_scene(SCENES / f"{name}.toml")
    )


def test_everything_that_moves_or_shows_changes_the_fingerprint() -> None:
    base = made()
    entry = base.targets[0]
    others = [
        made(size=0.3000001),
        dataclasses.replace(base, two_way=True),
        dataclasses.replace(base, camera=CameraEntry(shutter=90.0)),
        *(
            dataclasses.replace(base, targets=(msgspec.structs.replace(entry, **change),))
            for change in (
                {"resolution": 64},
                {"look": "clay"},
                {"material": MaterialEntry(speed=0.9)},
            )
        ),
    ]
    digests = {scene_digest(scene) for scene in (base, *others)}
    assert len(digests) == 1 + len(others)


def test_the_content_of_files_counts(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("speed.png", "still.png", "bone.obj", "start.npy")]
    speed, still, bone, start = map(str, paths)
    entry = RippleEntry(
        geom="egg",
        material=MaterialEntry(speed=MapEntry(map=speed)),
        still_map=still,
        inside=[InsideEntry(mesh=bone)],
        height=HeightEntry(field=start),
    )
    digests = []
    for changed in (None, *paths, None):
        for path in paths:
            path.write_bytes(b"other" if path == changed else b"same")
        digests.append(scene_digest(made(targets=(entry,))))
    assert (digests[0] == digests[-1], len(set(digests))) == (True, 1 + len(paths))
