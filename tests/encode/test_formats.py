"""Every format stores frames in segments and joins these; an image file holds a frame as it is."""

from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence

from ripple_sim.encode.clip import Stream
from ripple_sim.encode.output import ENDINGS, FORMATS, FRAME_FORMATS, Format

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


def test_every_valid_output_has_a_format_and_only_exr_is_linear() -> None:
    assert set(FORMATS) == {*ENDINGS, *FRAME_FORMATS}
    assert [name for name, video in FORMATS.items() if video.linear] == ["exr"]
    assert {name for name, video in FORMATS.items() if video.join is None} == set(FRAME_FORMATS)


@pytest.mark.parametrize("ending", ENDINGS)
def test_segments_are_joined_to_all_frames_in_order(tmp_path: Path, ending: str) -> None:
    video = FORMATS[ending]
    made = segments(tmp_path, video, LEVELS, min(video.length, 2))
    video.join(made, tmp_path / f"whole{ending}", STREAM)
    np.testing.assert_allclose(means(tmp_path / f"whole{ending}"), LEVELS, atol=4)


@pytest.mark.parametrize("ending", [".mp4", ".webm", ".gif", ".webp"])
def test_every_segment_plays_by_itself(tmp_path: Path, ending: str) -> None:
    """What an interrupted render leaves can be looked at."""
    video = FORMATS[ending]
    made = segments(tmp_path, video, LEVELS, min(video.length, 2))
    np.testing.assert_allclose([mean for path, _ in made for mean in means(path)], LEVELS, atol=4)


@pytest.mark.parametrize("channels", [3, 4])
def test_a_png_frame_is_kept_bit_for_bit_even_where_nothing_is_seen(tmp_path: Path, channels: int) -> None:
    frame = np.random.default_rng(2).integers(0, 256, (17, 23, channels), np.uint8)
    frame[:5, :, 3:] = 0
    still = FORMATS["png"].start(tmp_path / "frame.png", STREAM)
    still.write(frame)
    still.finish()
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "frame.png")), frame)


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
