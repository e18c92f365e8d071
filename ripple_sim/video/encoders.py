"""Encoders: each turns frames into one file (or folder) at the path it is given."""

from __future__ import annotations

import contextlib
import shutil
from fractions import Fraction
from pathlib import Path
from typing import Protocol

import av
import numpy as np
from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc
from numpy.typing import NDArray
from PIL import Image

from .output import FRAME_NAME

# A fixed number, since x264's output depends on it; small, since the renderer needs the processor too.
THREADS = 2


class Encoder(Protocol):
    """What `FrameWriter` drives from its thread."""

    path: Path

    def write(self, frame: NDArray[np.uint8]) -> None:
        """Encode one frame, uint8 [height, width, 3]."""

    def finish(self) -> None:
        """Flush what is pending; `path` is complete when this returns."""

    def discard(self) -> None:
        """Stop, and remove everything that was written."""


class FileEncoder:
    """One video stream in one container, encoded with PyAV.

    Parameters
    ----------
    container, codec : str
        FFmpeg's names.
    pixel_format : str
        FFmpeg's name. A YUV one is converted with, and tagged as, ITU-R BT.709 of limited range.
    options, container_options : dict
        Passed to the codec and to the container.
    """

    def __init__(
        self,
        path: Path,
        *,
        container: str,
        codec: str,
        pixel_format: str,
        width: int,
        height: int,
        fps: int,
        options: dict[str, str],
        container_options: dict[str, str] | None = None,
    ) -> None:
        self.path = path
        self._time_base = Fraction(1, fps)
        self._frames = 0
        # bitexact: Matroska and WebM would otherwise get random identifiers.
        self._container = av.open(
            str(path), "w", format=container, options={"fflags": "+bitexact", **(container_options or {})}
        )
        self._stream = self._container.add_stream(codec, rate=fps, options=options)
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, pixel_format
        self._pixel_format = pixel_format
        self._yuv = pixel_format.startswith("yuv")
        context = self._stream.codec_context
        context.thread_count = THREADS
        if self._yuv:
            context.color_primaries, context.color_trc = ColorPrimaries.BT709, ColorTrc.BT709
            context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG

    def write(self, frame: NDArray[np.uint8]) -> None:
        """Encode one frame."""
        self.encode(av.VideoFrame.from_ndarray(frame, format="rgb24"))

    def encode(self, image: av.VideoFrame) -> None:
        """Encode one frame that FFmpeg holds already."""
        if self._yuv:
            image = image.reformat(
                format=self._pixel_format, dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG
            )
        image.pts, image.time_base = self._frames, self._time_base
        self._frames += 1
        self._container.mux(self._stream.encode(image))

    def finish(self) -> None:
        """Flush the codec and close the container."""
        self._container.mux(self._stream.encode(None))
        self._container.close()

    def discard(self) -> None:
        """Close the container and remove the file."""
        with contextlib.suppress(av.FFmpegError, OSError):
            self._container.close()
        self.path.unlink(missing_ok=True)


def mp4_encoder(path: Path, width: int, height: int, fps: int) -> FileEncoder:
    """H.264 that browsers play, its index in front so that it starts before it is loaded."""
    # mbtree reads beyond its arrays where a row is no multiple of 8 macroblocks: the same frames then give another file
    # every time.
    return FileEncoder(
        path,
        container="mp4",
        codec="libx264",
        pixel_format="yuv420p",
        width=width,
        height=height,
        fps=fps,
        options={"crf": "18", "preset": "fast", "g": str(2 * fps), "x264-params": "mbtree=0"},
        container_options={"movflags": "+faststart"},
    )


def webm_encoder(path: Path, width: int, height: int, fps: int) -> FileEncoder:
    """VP9 at constant quality."""
    return FileEncoder(
        path,
        container="webm",
        codec="libvpx-vp9",
        pixel_format="yuv420p",
        width=width,
        height=height,
        fps=fps,
        options={"crf": "24", "b": "0", "deadline": "good", "cpu-used": "5", "row-mt": "1", "g": str(2 * fps)},
    )


class PngEncoder:
    """A folder of PNG frames."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._frames = 0
        path.mkdir()

    def write(self, frame: NDArray[np.uint8]) -> None:
        """Write one frame to a file of its own."""
        Image.fromarray(frame).save(self.path / FRAME_NAME.format(self._frames), compress_level=3)
        self._frames += 1

    def finish(self) -> None:
        """Do nothing: every frame is complete already."""

    def discard(self) -> None:
        """Remove the folder."""
        shutil.rmtree(self.path, ignore_errors=True)
