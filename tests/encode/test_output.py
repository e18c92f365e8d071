"""Outputs: which format a name means, and the limits of every format.

Every format stores frames in segments and joins these; an image file holds a frame as it is.
"""

from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence

from ripple_sim.encode import open_writer
from ripple_sim.encode.clip import Stream
from ripple_sim.encode.output import ENDINGS, FORMATS, Format, check_output, default_fps, video_format
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


@pytest.mark.parametrize(
    ("name", "size", "fps"),
    [
        ("clip.mp4", (16, 8192), 240),
        ("clip.gif", (8191, 17), 50),
        ("clip.webp", (17, 17), 1),
        ("frames", (8192, 16), 240),
    ],
)
def test_the_limits_themselves_are_valid(tmp_path: Path, name: str, size: tuple[int, int], fps: int) -> None:
    check_output(tmp_path / name, *size, fps)


@pytest.mark.parametrize(
    ("name", "size", "fps", "message"),
    [
        ("frames", (15, 16), 60, "15x16; valid is 16 to 8192"),
        ("frames", (16, 8193), 60, "16x8193; valid is 16 to 8192"),
        ("frames", (64.0, 48), 60, r"64\.0x48; valid is 16 to 8192"),
        ("clip.gif", (64, 48), 51, "a GIF's frame rate is 51; .* 1 to 50"),
        ("clip.webp", (64, 48), 241, "frame rate is 241; .* 1 to 240"),
        ("frames", (64, 48), 30.0, r"frame rate is 30\.0; valid is a whole number"),
        ("frames", (64, 48), -1, "frame rate is -1;"),
    ],
)
def test_what_lies_beyond_the_limits_is_refused(
    tmp_path: Path, name: str, size: tuple[int, int], fps: int, message: str
) -> None:
    with pytest.raises(VideoError, match=message):
        check_output(tmp_path / name, *size, fps)


@pytest.mark.parametrize("name", ["frame_0000.png", "frame_00000.jpg", "frame_00000.png.bak", ".frame_00000.png", "a"])
def test_a_folder_that_holds_anything_but_frames_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "frame_00000.png").touch()
    (tmp_path / "frame_100000.exr").touch()
    check_output(tmp_path, 64, 48, 25)
    (tmp_path / name).touch()
    with pytest.raises(VideoError, match="it holds other files"):
        check_output(tmp_path, 64, 48, 25)
    assert len(list(tmp_path.iterdir())) == 3


def test_a_link_to_a_folder_of_frames_is_refused_before_anything_is_rendered(tmp_path: Path) -> None:
    """The finished folder takes the place of the older one by renaming, which a link does not allow."""
    (tmp_path / "older").mkdir()
    (tmp_path / "frames").symlink_to(tmp_path / "older")
    with pytest.raises(VideoError, match=r"frames: it is a link; name the folder .*older"):
        check_output(tmp_path / "frames", 64, 48, 25)
    check_output(tmp_path / "older", 64, 48, 25)


def test_a_file_that_appears_among_the_older_frames_meanwhile_is_not_deleted(tmp_path: Path) -> None:
    frame = np.zeros((16, 16, 3), np.uint8)
    with open_writer(tmp_path / "frames", width=16, height=16, fps=25) as writer:
        writer.write(frame)
    with (
        pytest.raises(EncodingError, match=r"holds other files \(notes\.txt\)"),
        open_writer(tmp_path / "frames", width=16, height=16, fps=25) as writer,
    ):
        writer.write(frame)
        (tmp_path / "frames" / "notes.txt").write_text("mine")
    assert sorted(path.name for path in (tmp_path / "frames").iterdir()) == ["frame_00000.png", "notes.txt"]


def test_default_rates_are_valid_for_their_formats(tmp_path: Path) -> None:
    for name in ("clip.mp4", "clip.webm", "clip.GIF", "clip.webp", "frames"):
        check_output(tmp_path / name, 64, 48, default_fps(tmp_path / name))


def test_frames_beyond_the_highest_level_of_h264_are_refused_where_others_hold_them(tmp_path: Path) -> None:
    check_output(tmp_path / "clip.mp4", 8192, 4352, 25)
    with pytest.raises(VideoError, match=r"8192x8192; \.mp4 is H\.264.*or write \.webm, \.gif, \.webp or a folder"):
        check_output(tmp_path / "clip.mp4", 8192, 8192, 25)
    for name in ("clip.webm", "clip.gif", "clip.webp", "frames"):
        check_output(tmp_path / name, 8192, 8192, 25)


@pytest.mark.parametrize(
    "name", ["a:b.mp4", "pipe:1.mp4", "concat:x.mp4", "file:z.gif", "%d.webm", "http:x.webp", "-.mp4"]
)
def test_no_name_is_taken_for_a_protocol(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    with open_writer(name, width=16, height=16, fps=25) as writer:
        writer.write(np.zeros((16, 16, 3), np.uint8))
    assert [each.name for each in tmp_path.iterdir()] == [name]


STREAM = Stream(32, 16, 25)
LEVELS = [10, 60, 110, 160, 210]


def segments(folder: Path, video: Format, levels: list[int], length: int) -> list[tuple[Path, int]]:
    """Segments of frames of one grey each, shorter than the format's."""
    made = []
    for first in range(0, len(levels), length):
        path = folder / f"{first}{video.suffix}"
        segment = video.start(path, STREAM)
        for level in levels[first : first + length]:
            segment.write(np.full((STREAM.height, STREAM.width, 3), level, np.uint8))
        segment.finish()
        made.append((path, first))
    return made


def means(path: Path) -> list[float]:
    if path.suffix == ".webp":
        with Image.open(path) as image:
            return [float(np.mean(frame.convert("RGB"))) for frame in ImageSequence.Iterator(image)]
    with av.open(str(path)) as container:
        return [float(image.to_ndarray(format="rgb24").mean()) for image in container.decode(video=0)]


@pytest.mark.parametrize("ending", [".mp4", ".webm", ".gif", ".webp"])
def test_every_segment_plays_by_itself(tmp_path: Path, ending: str) -> None:
    """What an interrupted render leaves can be looked at."""
    video = FORMATS[ending]
    made = segments(tmp_path, video, LEVELS, min(video.length, 2))
    np.testing.assert_allclose([mean for path, _ in made for mean in means(path)], LEVELS, atol=4)


def test_a_segment_that_is_closed_unfinished_can_be_written_anew(tmp_path: Path) -> None:
    for ending in ENDINGS:
        video, path = FORMATS[ending], tmp_path / f"a{FORMATS[ending].suffix}"
        segment = video.start(path, STREAM)
        segment.write(np.zeros((STREAM.height, STREAM.width, 3), np.uint8))
        segment.close()
        again = video.start(path, STREAM)
        again.write(np.full((STREAM.height, STREAM.width, 3), 200, np.uint8))
        again.finish()
        np.testing.assert_allclose(means(path), [200], atol=4)
