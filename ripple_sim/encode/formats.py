"""The formats of videos: how each stores its frames in segments, and joins the segments."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeAlias

from numpy.typing import NDArray
from PIL import Image

from ripple_sim.errors import VideoError

from .clip import H264, LOSSLESS, VP9, Clip, Codec, Stream, join_clips
from .exr import write_exr
from .gif import join_gif
from .replace import MARK, png_mark
from .webp import join_webp

# Frames in a clip, which begins with a key frame. A killed render loses so many frames at most.
FRAMES_IN_CLIP = 48

# A segment that is being written: a clip, or an image.
Segment: TypeAlias = Clip | SimpleNamespace

# Files of segments, each with the number of its first frame.
Segments = Sequence[tuple[Path, int]]

# Endings of videos, and names of the formats of a folder's frames.
ENDINGS = (".mp4", ".webm", ".gif", ".webp")
FRAME_FORMATS = ("png", "exr")
_VALID = (
    f"it must be {', '.join(ENDINGS)}, or a name without ending for a folder of PNG or EXR frames"
)


def _still(write: Callable[[NDArray], None]) -> SimpleNamespace:
    """A segment of one frame, in an image file of its own.

    Once `write` has returned, the file is complete and closed.
    """
    return SimpleNamespace(write=write, finish=lambda: None, close=lambda: None)


def _by_pillow(path: Path, **settings: Any) -> SimpleNamespace:
    """A segment of one frame, in an image file that Pillow writes with these settings."""
    return _still(lambda frame: Image.fromarray(frame).save(path, **settings))


@dataclasses.dataclass(frozen=True)
class Format:
    """How the videos of one ending, or the frames of a folder, are made.

    Attributes
    ----------
    suffix : str
        Ending of a segment's file.
    start : callable
        Begins a segment at a path.
    length : int
        Frames in a segment; the last one may have fewer.
    join : callable or None
        Makes the video of all segments, given with the number of each one's first frame. None:
        their folder is the video.
    linear : bool
        Whether frames are linear light, float16, colours multiplied by opacity; otherwise sRGB,
        uint8, not multiplied.
    """

    suffix: str
    start: Callable[[Path, Stream], Segment]
    length: int = 1
    join: Callable[[Segments, Path, Stream], None] | None = None
    linear: bool = False


def _of_clips(
    suffix: str, codec: Codec, join: Callable[[Segments, Path, Stream], None] | None = None
) -> Format:
    """A format whose segments are clips; `join_clips` joins them if no `join` is given."""
    return Format(
        suffix=suffix,
        start=lambda path, stream: Clip(path, codec, stream),
        length=FRAMES_IN_CLIP,
        join=join
        or (
            lambda clips, path, stream: join_clips(
                clips, path, codec.container, stream.fps, stream.sound
            )
        ),
    )


# By the ending of a video, or the name of the format of a folder's frames; see `video_format`.
FORMATS = {
    ".mp4": _of_clips(".mp4", H264),
    ".webm": _of_clips(".webm", VP9),
    ".gif": _of_clips(".mkv", LOSSLESS, join_gif),
    ".webp": Format(
        suffix=".webp",
        start=lambda path, stream: _by_pillow(
            path, format="WEBP", quality=88, method=3, xmp=MARK.encode()
        ),
        join=lambda stills, path, stream: join_webp([still for still, _ in stills], path, stream),
    ),
    "png": Format(
        suffix=".png",
        start=lambda path, stream: _by_pillow(
            path, format="PNG", compress_level=3, pnginfo=png_mark()
        ),
    ),
    "exr": Format(
        suffix=".exr",
        start=lambda path, stream: _still(lambda frame: write_exr(path, frame, stream.fps)),
        linear=True,
    ),
}


def video_format(path: Path, frame_format: str = "png") -> str:
    """Format of an output path: one of `ENDINGS`, or for a folder the format of its frames.

    Raises `VideoError` if the path is not a file name, has any other ending and is not a folder, or
    the frame format is unknown.
    """
    if frame_format not in FRAME_FORMATS:
        raise VideoError(
            f"frame format must be {' or '.join(map(repr, FRAME_FORMATS))}, got {frame_format!r}"
        )
    name = path.name
    if name in ("", "..") or name.lower() in ENDINGS:
        raise VideoError(f"output is {str(path)!r}, which is not a file name; {_VALID}")
    if path.is_dir() and path.suffix.lower() not in ENDINGS:
        return frame_format
    _, dot, ending = name[1:].rpartition(".")  # a name may begin with a dot
    if dot and f".{ending}".lower() not in ENDINGS:
        raise VideoError(f"{path} ends in {dot}{ending}; {_VALID}")
    return f"{dot}{ending}".lower() if dot else frame_format


def default_fps(path: Path) -> int:
    """Default frames per second: 60, and 25 for a GIF."""
    return 25 if video_format(path) == ".gif" else 60
