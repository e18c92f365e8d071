"""Animated WebP: Pillow reads back what was put together by hand."""

import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from ripple_sim.encode.clip import Stream
from ripple_sim.encode.images import join_webp


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
    assert content[:4] == b"RIFF"
    assert content[8:12] == b"WEBP"
    assert struct.unpack_from("<I", content, 4)[0] == len(content) - 8
    at, found = 12, []
    while at < len(content):
        name, size = struct.unpack_from("<4sI", content, at)
        found.append((name, content[at + 8 : at + 8 + size]))
        at += 8 + size + size % 2
    assert at == len(content)
    return found


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("size", [(16, 16), (33, 17), (300, 20)])
def test_lossless_frames_come_back_bit_for_bit(tmp_path: Path, size: tuple[int, int], channels: int) -> None:
    frames = noise(4, *size, channels)
    join_webp(stills(tmp_path, frames), tmp_path / "whole", Stream(*size, 25))
    with Image.open(tmp_path / "whole") as image:
        assert (image.size, image.n_frames, image.info["loop"]) == (size, 4, 0)
        back = [
            np.asarray(frame.convert("RGBA" if channels == 4 else "RGB")) for frame in ImageSequence.Iterator(image)
        ]
    np.testing.assert_array_equal(back, frames)


@pytest.mark.parametrize("fps", [1, 24, 30, 60, 144, 240])
def test_whole_milliseconds_do_not_drift(tmp_path: Path, fps: int) -> None:
    [still] = stills(tmp_path, noise(1, 16, 16, 3))
    join_webp([still] * 100, tmp_path / "whole", Stream(16, 16, fps))
    shown = [struct.unpack("<I", body[12:15] + b"\0")[0] for name, body in chunks((tmp_path / "whole").read_bytes())
             if name == b"ANMF"]  # fmt: skip
    assert len(shown) == 100
    assert np.abs(np.cumsum(shown) - 1000 * np.arange(1, 101) / fps).max() <= 0.5


@pytest.mark.parametrize("settings", [{}, {"lossless": False, "quality": 88}], ids=["lossless", "lossy"])
@pytest.mark.parametrize("seen", [None, 0, 2], ids=["no frame", "the first", "the last"])
def test_opacity_is_announced_when_any_frame_has_it(tmp_path: Path, settings: dict, seen: int | None) -> None:
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
