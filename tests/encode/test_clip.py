"""Clips: what is encoded in parts is decoded as one video, frame by frame at its time."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from ripple_sim.encode.clip import H264, LOSSLESS, VP9, Clip, Codec, Stream, join_clips

NOISE = np.random.default_rng(1).integers(0, 256, (7, 32, 48, 3), np.uint8)
STREAM = Stream(48, 32, 24)


def encode(path: Path, codec: Codec, frames: np.ndarray, stream: Stream = STREAM) -> Path:
    clip = Clip(path, codec, stream)
    for frame in frames:
        clip.write(frame)
    clip.finish()
    return path


def decode(path: Path) -> tuple[list[np.ndarray], list[Fraction]]:
    """Frames, and their times [s]."""
    with av.open(str(path)) as container:
        images = list(container.decode(video=0))
    return [image.to_ndarray(format="rgb24") for image in images], [image.pts * image.time_base for image in images]


def grey(levels: list[int]) -> np.ndarray:
    return np.array(levels, np.uint8)[:, None, None, None] * np.ones((32, 48, 3), np.uint8)


def test_the_lossless_codec_keeps_noise_bit_for_bit(tmp_path: Path) -> None:
    frames, _ = decode(encode(tmp_path / "noise.mkv", LOSSLESS, NOISE))
    np.testing.assert_array_equal(frames, NOISE)


@pytest.mark.parametrize("codec", [H264, VP9], ids=["H.264", "VP9"])
def test_levels_of_grey_survive_the_conversion_to_luma(tmp_path: Path, codec: Codec) -> None:
    levels = [0, 16, 64, 128, 235, 255]
    frames, _ = decode(encode(tmp_path / "grey", codec, grey(levels)))
    assert np.abs(np.array(frames, int) - grey(levels)).max() <= 3


@pytest.mark.parametrize("codec", [H264, VP9, LOSSLESS], ids=["mp4", "webm", "mkv"])
@pytest.mark.parametrize("fps", [1, 24, 59, 240])
def test_joined_clips_are_one_stream_with_every_frame_at_its_time(tmp_path: Path, codec: Codec, fps: int) -> None:
    """Matroska and WebM round times to milliseconds, a quarter of a frame at 240 frames a second."""
    levels = [20, 60, 100, 140, 180, 220]
    stream, clips = Stream(48, 32, fps), []
    for number, part in enumerate((levels[:3], levels[3:5], levels[5:])):  # the last has a single frame
        first = sum(map(len, (levels[:3], levels[3:5])[:number]))
        clips.append((encode(tmp_path / f"{number}", codec, grey(part), stream), first))
    join_clips(clips, tmp_path / "whole", codec.container, fps)
    frames, times = decode(tmp_path / "whole")
    assert np.abs([frame.mean() for frame in frames] - np.array(levels)).max() <= 3
    exact = [Fraction(number, fps) for number in range(len(levels))]
    rounding = Fraction(0) if codec.container == "mp4" else Fraction(1, 2000)
    assert all(abs(time - right) <= rounding for time, right in zip(times, exact, strict=True))


@pytest.mark.parametrize("content", [b"", b"no video at all" * 20], ids=["empty", "garbage"])
def test_a_broken_clip_is_an_error_and_no_shorter_video(tmp_path: Path, content: bytes) -> None:
    good = encode(tmp_path / "good", H264, grey([10, 200]))
    (tmp_path / "broken").write_bytes(content)
    with pytest.raises(av.FFmpegError):
        join_clips([(good, 0), (tmp_path / "broken", 2)], tmp_path / "whole", "mp4", 24)
    assert len(decode(good)[0]) == 2
