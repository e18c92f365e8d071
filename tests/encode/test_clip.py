"""Clips and stills: a video that is encoded in parts is decoded whole, each frame at its time."""

import itertools
import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence

from ripple_sim.encode import (
    H264,
    LOSSLESS,
    VP9,
    Clip,
    Codec,
    Stream,
    join_clips,
    join_gif,
    join_webp,
)

WIDTH = 48
HEIGHT = 32
STREAM = Stream(WIDTH, HEIGHT, 24)


def encode(path: Path, codec: Codec, frames: np.ndarray, stream: Stream = STREAM) -> Path:
    clip = Clip(path, codec, stream)
    for frame in frames:
        clip.write(frame)
    clip.finish()
    return path


def in_parts(folder: Path, codec: Codec, frames: np.ndarray, counts: list[int], stream: Stream):
    """Clips of so many frames each, with the number of their first."""
    first = np.cumsum([0, *counts]).tolist()
    return [
        (encode(folder / f"{a}.part", codec, frames[a:b], stream), a)
        for a, b in itertools.pairwise(first)
    ]


def decode(path: Path) -> tuple[list[np.ndarray], list[Fraction]]:
    """Frames, and their times [s]."""
    with av.open(str(path)) as container:
        images = list(container.decode(video=0))
    return [image.to_ndarray(format="rgb24") for image in images], [
        image.pts * image.time_base for image in images
    ]


def pictures(path: Path, mode: str = "RGB") -> list[np.ndarray]:
    with Image.open(path) as image:
        return [np.asarray(frame.convert(mode)) for frame in ImageSequence.Iterator(image)]


def plain(colors: list) -> np.ndarray:
    """Frames of one colour, or one grey, each."""
    return np.array(colors, np.uint8).reshape(len(colors), 1, 1, -1) * np.ones(
        (HEIGHT, WIDTH, 3), np.uint8
    )


def striped(count: int) -> np.ndarray:
    """Black and white, and a stripe that moves: few colours, which a palette holds."""
    frames = np.zeros((count, HEIGHT, WIDTH, 3), np.uint8)
    frames[:, HEIGHT // 2 :] = 255
    for number, frame in enumerate(frames):
        frame[:, 3 * number : 3 * number + 3] = (200, 30 + 10 * number, 90)
    return frames


def test_the_lossless_codec_keeps_noise_bit_for_bit(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (7, HEIGHT, WIDTH, 3), np.uint8)
    np.testing.assert_array_equal(decode(encode(tmp_path / "noise.mkv", LOSSLESS, noise))[0], noise)


@pytest.mark.parametrize("codec", [H264, VP9, LOSSLESS], ids=["mp4", "webm", "mkv"])
@pytest.mark.parametrize("fps", [1, 24, 59, 240])
def test_joined_clips_are_one_stream_with_every_frame_at_its_time(
    tmp_path: Path, codec: Codec, fps: int
) -> None:
    """Matroska and WebM round times to milliseconds, a quarter of a frame at 240 Hz."""
    levels = [20, 60, 100, 140, 180, 220]
    parts = in_parts(tmp_path, codec, plain(levels), [3, 2, 1], Stream(WIDTH, HEIGHT, fps))
    join_clips(parts, tmp_path / "whole", codec.container, fps)
    frames, times = decode(tmp_path / "whole")
    assert np.abs([frame.mean() for frame in frames] - np.array(levels)).max() <= 3
    exact = [Fraction(number, fps) for number in range(len(levels))]
    rounding = Fraction(0) if codec.container == "mp4" else Fraction(1, 2000)
    assert all(abs(time - right) <= rounding for time, right in zip(times, exact, strict=True))


@pytest.mark.parametrize("content", [b"", b"no video at all" * 20], ids=["empty", "garbage"])
@pytest.mark.parametrize("codec", [H264, LOSSLESS], ids=["mp4", "gif"])
def test_a_broken_clip_is_an_error_and_no_shorter_video(
    tmp_path: Path, codec: Codec, content: bytes
) -> None:
    broken = tmp_path / "broken"
    broken.write_bytes(content)
    [(whole_clip, first_frame)] = in_parts(tmp_path, codec, plain([10, 200]), [2], STREAM)
    parts = [(whole_clip, first_frame), (broken, 2)]
    with pytest.raises(av.FFmpegError):
        if codec is H264:
            join_clips(parts, tmp_path / "whole", "mp4", 24)
        else:
            join_gif(parts, tmp_path / "whole", STREAM)
    frames, *_ = decode(whole_clip)
    assert len(frames) == 2
    assert codec is H264 or not (tmp_path / "whole").exists()


@pytest.mark.parametrize("counts", [[1], [5], [4, 3], [2, 2, 1]])
def test_few_colours_of_a_gif_come_back_exactly_with_any_clips(
    tmp_path: Path, counts: list[int]
) -> None:
    frames = striped(sum(counts))
    join_gif(in_parts(tmp_path, LOSSLESS, frames, counts, STREAM), tmp_path / "whole.gif", STREAM)
    np.testing.assert_array_equal(pictures(tmp_path / "whole.gif"), frames)


@pytest.mark.parametrize("fps", [7, 25, 30, 50])
def test_a_gif_lasts_as_long_as_its_frames_and_repeats(tmp_path: Path, fps: int) -> None:
    """GIF counts in hundredths of a second, which must not add up."""
    stream = Stream(WIDTH, HEIGHT, fps)
    join_gif(
        in_parts(tmp_path, LOSSLESS, striped(11), [6, 5], stream), tmp_path / "whole.gif", stream
    )
    with Image.open(tmp_path / "whole.gif") as image:
        assert image.info["loop"] == 0
        shown = [frame.info["duration"] for frame in ImageSequence.Iterator(image)]
    assert np.abs(np.cumsum(shown)[:-1] - 1000 * np.arange(1, 11) / fps).max() <= 10
    assert len(shown) == 11


def noise(count: int, width: int, height: int, channels: int) -> np.ndarray:
    made = np.random.default_rng(5).integers(0, 256, (count, height, width, channels), np.uint8)
    if channels == 4:
        made[..., 3] |= 1  # libwebp forgets the colour of a pixel that is not seen at all
    return made


def stills(folder: Path, frames: np.ndarray, **settings: object) -> list[Path]:
    paths = [folder / f"{number}.webp" for number in range(len(frames))]
    for path, frame in zip(paths, frames, strict=True):
        Image.fromarray(frame).save(path, **{"lossless": True, **settings})
    return paths


def chunks(content: bytes) -> list[tuple[bytes, bytes]]:
    assert struct.unpack_from("<4sI4s", content) == (b"RIFF", len(content) - 8, b"WEBP")
    at = 12
    found = []
    while at < len(content):
        name, size = struct.unpack_from("<4sI", content, at)
        found.append((name, content[at + 8 : at + 8 + size]))
        at += 8 + size + size % 2
    assert at == len(content)
    return found


@pytest.mark.parametrize("fps", [1, 24, 30, 60, 144, 240])
def test_whole_milliseconds_do_not_drift(tmp_path: Path, fps: int) -> None:
    [still] = stills(tmp_path, noise(1, 16, 16, 3))
    join_webp([still] * 100, tmp_path / "whole", Stream(16, 16, fps))
    whole = (tmp_path / "whole").read_bytes()
    shown = [
        struct.unpack("<I", body[12:15] + b"\0")[0]
        for name, body in chunks(whole)
        if name == b"ANMF"
    ]
    assert len(shown) == 100
    assert np.abs(np.cumsum(shown) - 1000 * np.arange(1, 101) / fps).max() <= 0.5


@pytest.mark.parametrize(
    "settings", [{}, {"lossless": False, "quality": 88}], ids=["lossless", "lossy"]
)
@pytest.mark.parametrize("seen", [None, 0, 2], ids=["no frame", "the first", "the last"])
def test_opacity_is_announced_when_any_frame_has_it(
    tmp_path: Path, settings: dict, seen: int | None
) -> None:
    frames = noise(3, 20, 18, 4)
    frames[..., 3] = 255
    if seen is not None:
        frames[seen, 4:9, 4:9, 3] = 100
    join_webp(stills(tmp_path, frames, **settings), tmp_path / "whole", Stream(20, 18, 25))
    (name, header), *_ = chunks((tmp_path / "whole").read_bytes())
    assert name == b"VP8X"
    assert bool(header[0] & 0x10) == (seen is not None)
    if seen is not None:
        with Image.open(tmp_path / "whole") as image:
            image.seek(seen)
            alpha = np.asarray(image.convert("RGBA"))[..., 3]
        np.testing.assert_array_equal(alpha, frames[seen, ..., 3])


def test_metadata_of_a_still_stays_out_of_the_animation(tmp_path: Path) -> None:
    frames = noise(2, 16, 16, 3)
    paths = stills(tmp_path, frames, exif=b"Exif\0\0odd", xmp=b"<x/>")
    assert b"EXIF" in paths[0].read_bytes()
    join_webp(paths, tmp_path / "whole", Stream(16, 16, 25))
    assert b"EXIF" not in (tmp_path / "whole").read_bytes()
    with Image.open(tmp_path / "whole") as image:
        np.testing.assert_array_equal(image.convert("RGB"), frames[0])


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("size", [(16, 16), (33, 17), (300, 20)])
def test_lossless_webp_frames_come_back_bit_for_bit(
    tmp_path: Path, size: tuple[int, int], channels: int
) -> None:
    frames = noise(4, *size, channels)
    join_webp(stills(tmp_path, frames), tmp_path / "whole", Stream(*size, 25))
    with Image.open(tmp_path / "whole") as image:
        assert (image.size, image.n_frames, image.info["loop"]) == (size, 4, 0)
    np.testing.assert_array_equal(
        pictures(tmp_path / "whole", "RGBA" if channels == 4 else "RGB"), frames
    )
