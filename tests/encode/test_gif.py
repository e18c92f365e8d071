"""GIFs: one palette for all frames, which are found again in their colours and at their times."""

from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence

from ripple_sim.encode.clip import LOSSLESS, Clip, Stream
from ripple_sim.encode.images import join_gif

WIDTH, HEIGHT = 40, 24


def striped(number: int) -> np.ndarray:
    """Black and white, and a stripe that moves: few enough colours for a palette to hold them all."""
    frame = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    frame[HEIGHT // 2 :] = 255
    frame[:, 3 * number : 3 * number + 3] = (200, 30 + 10 * number, 90)
    return frame


def clips(folder: Path, counts: list[int], stream: Stream) -> list[tuple[Path, int]]:
    made, first = [], 0
    for count in counts:
        clip = Clip(folder / f"{first}.mkv", LOSSLESS, stream)
        for number in range(first, first + count):
            clip.write(striped(number))
        clip.finish()
        made.append((folder / f"{first}.mkv", first))
        first += count
    return made


def frames(path: Path) -> list[np.ndarray]:
    with Image.open(path) as image:
        return [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(image)]


@pytest.mark.parametrize("counts", [[1], [5], [4, 3], [2, 2, 1]])
def test_few_colours_come_back_exactly_however_the_frames_are_cut_into_clips(tmp_path: Path, counts: list[int]) -> None:
    stream = Stream(WIDTH, HEIGHT, 25)
    join_gif(clips(tmp_path, counts, stream), tmp_path / "whole.gif", stream)
    np.testing.assert_array_equal(frames(tmp_path / "whole.gif"), [striped(number) for number in range(sum(counts))])


@pytest.mark.parametrize("fps", [7, 25, 30, 50])
def test_a_gif_lasts_as_long_as_its_frames_and_repeats(tmp_path: Path, fps: int) -> None:
    """GIF counts in hundredths of a second, which must not add up."""
    stream = Stream(WIDTH, HEIGHT, fps)
    join_gif(clips(tmp_path, [6, 5], stream), tmp_path / "whole.gif", stream)
    with Image.open(tmp_path / "whole.gif") as image:
        assert image.info["loop"] == 0
        shown = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
    assert np.abs(np.cumsum(shown)[:-1] - 1000 * np.arange(1, 11) / fps).max() <= 10
    assert len(shown) == 11


def test_the_palette_knows_colours_that_the_last_clip_alone_has(tmp_path: Path) -> None:
    stream, colors = Stream(WIDTH, HEIGHT, 25), [(0, 0, 0), (10, 10, 10), (255, 0, 200)]
    made = []
    for number, color in enumerate(colors):
        clip = Clip(tmp_path / f"{number}.mkv", LOSSLESS, stream)
        clip.write(np.full((HEIGHT, WIDTH, 3), color, np.uint8))
        clip.finish()
        made.append((tmp_path / f"{number}.mkv", number))
    join_gif(made, tmp_path / "whole.gif", stream)
    assert [tuple(frame[5, 5]) for frame in frames(tmp_path / "whole.gif")] == colors


def test_a_broken_clip_is_an_error_and_no_shorter_gif(tmp_path: Path) -> None:
    stream = Stream(WIDTH, HEIGHT, 25)
    good = clips(tmp_path, [2], stream)
    (tmp_path / "broken.mkv").write_bytes(b"no video")
    with pytest.raises(av.FFmpegError):
        join_gif([*good, (tmp_path / "broken.mkv", 2)], tmp_path / "whole.gif", stream)
    assert not (tmp_path / "whole.gif").exists()
