"""Clips: short runs of frames, each encoded to a file of its own, that join without re-encoding."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc
from numpy.typing import NDArray

from .replace import MARK

# Fixed, since x264's output depends on it; small, since the renderer needs the processor too.
THREADS = 2


@dataclasses.dataclass(frozen=True)
class Stream:
    """Size [pixels] and rate [frames/s] of a video."""

    width: int
    height: int
    fps: int


@dataclasses.dataclass(frozen=True)
class Codec:
    """How frames are encoded.

    Attributes
    ----------
    container, name, pixel_format : str
        FFmpeg's names. A YUV pixel format is converted with, and tagged as, ITU-R BT.709 of limited range.
    options : dict
        Passed to the codec.
    """

    container: str
    name: str
    pixel_format: str
    options: dict[str, str] = dataclasses.field(default_factory=dict)

    @property
    def yuv(self) -> bool:
        """Whether colours are stored as luma and chroma."""
        return self.pixel_format.startswith("yuv")


# What browsers play. mbtree reads beyond its arrays where a row is not a multiple of 8 macroblocks: the same frames
# would then give another file every time.
H264 = Codec("mp4", "libx264", "yuv420p", {"crf": "17", "preset": "veryfast", "x264-params": "mbtree=0"})
VP9 = Codec(
    "webm", "libvpx-vp9", "yuv420p", {"crf": "24", "b": "0", "deadline": "good", "cpu-used": "5", "row-mt": "1"}
)
LOSSLESS = Codec("matroska", "libx264rgb", "rgb24", {"qp": "0", "preset": "ultrafast"})
GIF = Codec("gif", "gif", "pal8")


class Clip:
    """A file with one video stream, being written by PyAV."""

    def __init__(self, path: Path, codec: Codec, stream: Stream) -> None:
        self._codec = codec
        self._time_base = Fraction(1, stream.fps)
        self._frames = 0
        self._container = open_container(path, codec.container)
        self._stream = self._container.add_stream(codec.name, rate=stream.fps, options=codec.options)
        self._stream.width, self._stream.height, self._stream.pix_fmt = stream.width, stream.height, codec.pixel_format
        context = self._stream.codec_context
        context.thread_count = THREADS
        if codec.yuv:
            context.color_primaries, context.color_trc = ColorPrimaries.BT709, ColorTrc.BT709
            context.colorspace, context.color_range = Colorspace.ITU709, ColorRange.MPEG

    def write(self, frame: NDArray[np.uint8]) -> None:
        """Encode one frame, uint8 [height, width, 3]."""
        self.encode(av.VideoFrame.from_ndarray(frame, format="rgb24"))

    def encode(self, image: av.VideoFrame) -> None:
        """Encode one frame of FFmpeg's."""
        if self._codec.yuv:
            image = image.reformat(
                format=self._codec.pixel_format, dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG
            )
        image.pts, image.time_base = self._frames, self._time_base
        self._frames += 1
        self._container.mux(self._stream.encode(image))

    def finish(self) -> None:
        """Flush the codec and close the file."""
        try:
            self._container.mux(self._stream.encode(None))
        finally:
            self.close()

    def close(self) -> None:
        """Close the file, which is useless unless it is finished."""
        self._container.close()


def open_container(path: Path, container: str) -> Any:
    """Open a file for writing; the same content gives the same bytes."""
    # bitexact: no random identifiers in Matroska and WebM. faststart: an MP4's index goes in front, so that playback
    # starts before the file is loaded.
    options = {"fflags": "+bitexact", **({"movflags": "+faststart"} if container == "mp4" else {})}
    opened = av.open(str(path), "w", format=container, options=options)
    opened.metadata["comment"] = MARK
    return opened


def join_clips(clips: Sequence[tuple[Path, int]], path: Path, container: str, fps: int) -> None:
    """Concatenate clips into one file.

    Parameters
    ----------
    clips : sequence of (path, number)
        Clips of one codec, and the number of each one's first frame in the whole.
    path : path
        To write.
    container : str
        FFmpeg's name.
    fps : int
        Frames a second.
    """
    output = open_container(path, container)
    try:
        stream = None
        for clip, first in clips:
            with av.open(str(clip)) as source:
                video = source.streams.video[0]
                if stream is None:
                    stream = output.add_stream_from_template(video)
                    stream.time_base = Fraction(1, fps)
                for packet in source.demux(video):
                    if packet.pts is None:  # end of stream
                        continue
                    # exact frame numbers, whatever the container's time base
                    tick = packet.time_base
                    decoded = packet.pts if packet.dts is None else packet.dts
                    packet.pts, packet.dts = (first + round(time * tick * fps) for time in (packet.pts, decoded))
                    packet.time_base, packet.duration = Fraction(1, fps), 1
                    packet.stream = stream
                    output.mux_one(packet)
    finally:
        output.close()
