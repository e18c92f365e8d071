"""Opening a writer: the arguments decide the frames that it takes, and a refusal leaves nothing behind."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from unfinished_videos import contents

from ripple_sim.encode import open_writer
from ripple_sim.errors import EncodingError, VideoError

SIZE = {"width": 24, "height": 16, "fps": 25}


@pytest.mark.parametrize("transparent", [False, True])
def test_a_path_of_text_makes_a_folder_of_the_frames_themselves(tmp_path: Path, transparent: bool) -> None:
    channels = 4 if transparent else 3
    frames = np.random.default_rng(3).integers(0, 256, (3, 16, 24, channels), np.uint8)
    with open_writer(str(tmp_path / "new" / "frames"), **SIZE, transparent=transparent) as writer:
        for frame in frames:
            writer.write(frame)
    back = [np.asarray(Image.open(path)) for path in sorted((tmp_path / "new" / "frames").iterdir())]
    np.testing.assert_array_equal(back, frames)
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["frames"]


def test_a_frame_without_opacity_is_refused_where_it_was_announced(tmp_path: Path) -> None:
    with (
        pytest.raises(VideoError, match=r"frame is uint8 \[16, 24, 3\]; valid is uint8 \[16, 24, 4\]"),
        open_writer(tmp_path / "clip.webp", **SIZE, transparent=True) as writer,
    ):
        writer.write(np.zeros((16, 24, 3), np.uint8))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "options"),
    [("clip.mp4", {"width": 25}), ("clip.gif", {"fps": 60}), ("clip.mp4", {"transparent": True}), ("a.xyz", {})],
)
def test_a_refused_writer_makes_no_folder(tmp_path: Path, name: str, options: dict) -> None:
    with pytest.raises(VideoError):
        open_writer(tmp_path / "new" / name, **{**SIZE, **options})
    assert list(tmp_path.iterdir()) == []


def test_a_second_writer_of_the_same_video_is_refused_and_the_first_goes_on(tmp_path: Path) -> None:
    frame = np.full((16, 24, 3), 77, np.uint8)
    with open_writer(tmp_path / "frames", **SIZE) as writer:
        writer.write(frame)
        with pytest.raises(VideoError, match="another process is writing"):
            open_writer(tmp_path / "frames", **SIZE)
        writer.write(frame)
    assert len(list((tmp_path / "frames").iterdir())) == 2


def test_without_settings_nothing_survives_an_interruption_and_with_them_it_goes_on(tmp_path: Path) -> None:
    frame = np.full((16, 24, 3), 77, np.uint8)
    for settings, left in ((None, []), ({"the scene": "a"}, ["frames.part"])):
        with (
            pytest.raises(KeyboardInterrupt),
            open_writer(tmp_path / "frames", **SIZE, settings=settings) as writer,
        ):
            writer.write(frame)
            while not writer._part.frames:
                writer._encoder._thread.join(0.001)
            raise KeyboardInterrupt
        assert [path.name for path in tmp_path.iterdir()] == left
    with open_writer(tmp_path / "frames", **SIZE, settings={"the scene": "a"}, resume=True) as writer:
        assert writer.frames == 1
        writer.write(frame)
    assert sorted(contents(tmp_path)) == ["frames/frame_00000.png", "frames/frame_00001.png"]


def test_a_file_in_the_place_of_a_parent_folder_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(EncodingError, match=r"cannot write .*file/clip\.mp4: Not a directory"):
        open_writer(tmp_path / "file" / "clip.mp4", **SIZE)
    assert (tmp_path / "file").read_text() == "mine"
