"""Outputs: formats by name, limits of every format, and files that are not written over."""

from pathlib import Path

import numpy as np
import pytest

from ripple_sim.encode import check_output, default_fps, open_writer, video_format
from ripple_sim.errors import EncodingError, VideoError


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("clip.mp4", ".mp4"),
        ("CLIP.MP4", ".mp4"),
        ("a.b.WebM", ".webm"),
        ("frames", "png"),
        ("folder.mp4/frames", "png"),
        (".hidden", "png"),
        (".hidden.gif", ".gif"),
        ("v1.2", "png"),  # a folder that is there
    ],
)
def test_the_last_ending_of_a_name_is_its_format(tmp_path: Path, name: str, form: str) -> None:
    (tmp_path / "v1.2").mkdir()
    assert video_format(tmp_path / name) == form
    assert video_format(tmp_path / name, "exr") == ("exr" if form == "png" else form)


def test_the_limits_themselves_and_default_rates_are_valid(tmp_path: Path) -> None:
    limits = ("new/clip.mp4", 16, 8192, 240), ("clip.gif", 8191, 17, 50), ("clip.webp", 17, 17, 1)
    for name, width, height, fps in (*limits, ("frames", 8192, 16, 240)):
        check_output(tmp_path / name, width, height, fps)
        check_output(tmp_path / name, width, height, default_fps(tmp_path / name))
        assert (default_fps(tmp_path / name) == 60) == (name != "clip.gif")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "size", "fps", "message"),
    [
        ("clip.avi", (1280, 720), 60, r"\.avi.*must be \.mp4, \.webm, \.gif, \.webp"),
        (".mp4", (1280, 720), 60, r"\.mp4', which is not a file name"),
        ("clip.", (1280, 720), 60, r"ends in \.; it must be"),
        ("..", (1280, 720), 60, "must be .mp4"),
        ("clip.mp4", (1281, 720), 60, "1281x720.*even.*1282x720"),
        ("clip.webm", (1280, 719), 60, "1280x719.*even.*1280x720"),
        ("clip.gif", (0, 720), 25, "must be 16 .*, got 0x720"),
        ("frames", (15, 16), 60, "must be 16 to 8192 .*, got 15x16"),
        ("frames", (16, 8193), 60, "must be 16 to 8192 .*, got 16x8193"),
        ("frames", (64.0, 48), 60, r"must be 16 to 8192 .*, got 64\.0x48"),
        ("clip.mp4", (1280, 720), 0, "rate must be .* 1 to 240 .*, got 0"),
        ("clip.webp", (64, 48), 241, "frame rate must be .* 1 to 240 .*, got 241"),
        ("clip.gif", (64, 48), 51, "a GIF's frame rate must be .* 1 to 50 .*, got 51"),
        ("frames", (64, 48), 30.0, r"frame rate must be a whole number .*, got 30\.0"),
        ("a_file", (1280, 720), 60, "is not a folder"),
        ("a_folder.mp4", (1280, 720), 60, "is a folder"),
        ("photos", (1280, 720), 60, r"other files \(me\.jpg\)"),
        ("a_file/clip.mp4", (1280, 720), 60, "cannot write .*a_file.*: Not a directory"),
        ("/proc/clip.mp4", (1280, 720), 60, "cannot write /proc"),
    ],
)
def test_invalid_outputs_are_refused_before_rendering(
    tmp_path: Path, name: str, size: tuple, fps: int, message: str
):
    (tmp_path / "a_file").write_text("mine")
    (tmp_path / "a_folder.mp4").mkdir()
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "me.jpg").touch()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(EncodingError if "/" in name else VideoError, match=message) as refusal:
        check_output(tmp_path / name, *size, fps)
    assert "\n" not in str(refusal.value)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    "name", ["frame_0000.png", "frame_00000.jpg", "frame_00000.png.bak", ".frame_00000.png", "a"]
)
def test_a_folder_that_holds_anything_but_frames_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "frame_00000.png").touch()
    (tmp_path / "frame_100000.exr").touch()
    check_output(tmp_path, 64, 48, 25)
    (tmp_path / name).touch()
    with pytest.raises(VideoError, match="it holds other files"):
        check_output(tmp_path, 64, 48, 25)
    assert len(list(tmp_path.iterdir())) == 3


def test_a_link_to_a_folder_of_frames_is_refused_before_anything_is_rendered(
    tmp_path: Path,
) -> None:
    """Renaming replaces the older folder by the finished one; a link does not allow that."""
    (tmp_path / "older").mkdir()
    (tmp_path / "frames").symlink_to(tmp_path / "older")
    with pytest.raises(VideoError, match=r"frames: it is a link; name the folder .*older"):
        check_output(tmp_path / "frames", 64, 48, 25)
    check_output(tmp_path / "older", 64, 48, 25)


def test_a_file_that_appears_among_the_older_frames_meanwhile_is_not_deleted(
    tmp_path: Path,
) -> None:
    frame = np.zeros((16, 16, 3), np.uint8)
    folder = tmp_path / "frames"
    with open_writer(folder, width=16, height=16, fps=25) as writer:
        writer.write(frame)
    refused = pytest.raises(EncodingError, match=r"holds other files \(notes\.txt\)")
    with refused, open_writer(folder, width=16, height=16, fps=25) as writer:
        writer.write(frame)
        (folder / "notes.txt").write_text("mine")
    assert sorted(path.name for path in folder.iterdir()) == ["frame_00000.png", "notes.txt"]


def test_frames_too_large_for_h264_are_refused_for_mp4_only(
    tmp_path: Path,
) -> None:
    check_output(tmp_path / "clip.mp4", 8192, 4352, 25)
    with pytest.raises(
        VideoError, match=r"8192x8192; \.mp4 is H\.264.*or write \.webm, \.gif, \.webp or a folder"
    ):
        check_output(tmp_path / "clip.mp4", 8192, 8192, 25)
    for name in ("clip.webm", "clip.gif", "clip.webp", "frames"):
        check_output(tmp_path / name, 8192, 8192, 25)


@pytest.mark.parametrize(
    "name",
    ["a:b.mp4", "pipe:1.mp4", "concat:x.mp4", "file:z.gif", "%d.webm", "http:x.webp", "-.mp4"],
)
def test_file_names_that_look_like_urls_are_written_as_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with open_writer(name, width=16, height=16, fps=25) as writer:
        writer.write(np.zeros((16, 16, 3), np.uint8))
    assert [each.name for each in tmp_path.iterdir()] == [name]
