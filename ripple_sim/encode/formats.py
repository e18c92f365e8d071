"""The formats: how each stores its frames in segments, and joins these to the video."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from .clip import H264, LOSSLESS, VP9, Clip, Codec, Stream, join_clips
from .exr import Exr
from .gif import join_gif
from .mark import MARK, png_mark
from .webp import join_webp

# As many frames may be lost when a render is killed; each clip begins with a key frame.
FRAMES_IN_CLIP = 48

Segments = Sequence[tuple[Path, int]]


class Segment(Protocol):
    """A file of some frames that is being written."""

    def write(self, frame: NDArray) -> None:
        """Add one frame, [height, width, 3 or 4], of the format's type."""

    def finish(self) -> None:
        """Complete the file."""

    def close(self) -> None:
        """Leave the file incomplete."""


class Still:
    """One frame in an image file of its own."""

    def __init__(self, path: Path, **settings: Any) -> None:
        self._path, self._settings = path, settings

    def write(self, frame: NDArray[np.uint8]) -> None:
        """Write the image."""
        Image.fromarray(frame).save(self._path, **self._settings)

    def finish(self) -> None:
        """Do nothing: the image is complete."""

    def close(self) -> None:
        """Do nothing: no file is open."""


@dataclasses.dataclass(frozen=True)
class Format:
    """How the videos of one ending, or the frames of a folder, are made.

    Attributes
    ----------
    suffix : str
        Ending of a segment's file.
    length : int
        Frames in a segment; the last one may have fewer.
    start : callable
        Begins a segment at a path.
    join : callable or None
        Makes the video of all segments, given with the number of each one's first frame. None: their folder is the
        video.
    linear : bool
        Whether frames are linear light, float16, colours multiplied by opacity; otherwise sRGB, uint8, not multiplied.
    """

    suffix: str
    length: int
    start: Callable[[Path, Stream], Segment]
    join: Callable[[Segments, Path, Stream], None] | None
    linear: bool = False


def _of_clips(suffix: str, codec: Codec, join: Callable[[Segments, Path, Stream], None] | None = None) -> Format:
    return Format(
        suffix=suffix,
        length=FRAMES_IN_CLIP,
        start=lambda path, stream: Clip(path, codec, stream),
        join=join or (lambda clips, path, stream: join_clips(clips, path, codec.container, stream.fps)),
    )


# By the ending of a video, or the name of the format of a folder's frames; see `video_format`.
FORMATS = {
    ".mp4": _of_clips(".mp4", H264),
    ".webm": _of_clips(".webm", VP9),
    ".gif": _of_clips(".mkv", LOSSLESS, join_gif),
    ".webp": Format(
        suffix=".webp",
        length=1,
        start=lambda path, stream: Still(path, format="WEBP", quality=88, method=3, xmp=MARK.encode()),
        join=lambda stills, path, stream: join_webp([still for still, _ in stills], path, stream),
    ),
    "png": Format(
        suffix=".png",
        length=1,
        start=lambda path, stream: Still(path, format="PNG", compress_level=3, pnginfo=png_mark()),
        join=None,
    ),
    "exr": Format(suffix=".exr", length=1, start=Exr, join=None, linear=True),
}
