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

# Threads of a codec: a fixed number, since x264's output depends on it, and a small one, since the
# renderer needs the processor too.
THREADS = 2

# Samples of the sound in a second [1/s].
SOUND_RATE = 48_000

# Codec of the sound, by container.
_AUDIO_CODECS = {"mp4": "aac", "webm": "libopus"}

# Rate of the encoded sound [bit/s].
_AUDIO_BIT_RATE = 192_000

# Samples that are encoded together: 20 ms.
_BLOCK_SAMPLES = 960


@dataclasses.dataclass(frozen=True, eq=False)
class Stream:
    """Size [pixels] and rate [frames/s] of a video, and its sound, one channel from -1 to 1."""

    width: int
    height: int
    fps: int
    sound: NDArray | None = None


@dataclasses.dataclass(frozen=True)
class Codec:
    """How frames are encoded.

    Attributes
    ----------
    container, name, pixel_format : str
        FFmpeg's names. A YUV pixel format is converted with, and tagged as, ITU-R BT.709 of limited
        range.
    options : dict
        Passed to the codec.
    """

    container: str
    name: str
    pixel_format: str
    options: dict[str, str] = dataclasses.field(default_factory=dict)


# What all browsers play, in a .mp4. mbtree reads beyond its arrays where a row is not a multiple of
# 8 macroblocks: the same frames would then give another file every time.
H264 = Codec(
    "mp4", "libx264", "yuv420p", {"crf": "17", "preset": "veryfast", "x264-params": "mbtree=0"}
)
# What browsers play in a .webm.
VP9 = Codec(
    "webm",
    "libvpx-vp9",
    "yuv420p",
    {"crf": "24", "b": "0", "deadline": "good", "cpu-used": "5", "row-mt": "1"},
)
# For the clips of a GIF: its colours are chosen when all frames are there.
LOSSLESS = Codec("matroska", "libx264rgb", "rgb24", {"qp": "0", "preset": "ultrafast"})
GIF = Codec("gif", "gif", "pal8")


class Clip:
    """A file with one video stream, being written by PyAV."""

    def __init__(self, path: Path, codec: Codec, stream: Stream) -> None:
        # the pixel format, if its colours are luma and chroma
        self._yuv = codec.pixel_format if codec.pixel_format.startswith("yuv") else None
        self._time_base = Fraction(1, stream.fps)
        self._frames = 0
        self._container = open_container(path, codec.container)
        self._stream = self._container.add_stream(
            codec.name, rate=stream.fps, options=codec.options
        )
        self._stream.width = stream.width
        self._stream.height = stream.height
        self._stream.pix_fmt = codec.pixel_format
        context = self._stream.codec_context
        context.thread_count = THREADS
        if self._yuv:
            context.color_primaries = ColorPrimaries.BT709
            context.color_trc = ColorTrc.BT709
            context.colorspace = Colorspace.ITU709
            context.color_range = ColorRange.MPEG

    def write(self, frame: NDArray[np.uint8]) -> None:
        """Encode one frame, uint8 [height, width, 3]."""
        self.encode(av.VideoFrame.from_ndarray(frame, format="rgb24"))

    def encode(self, image: av.VideoFrame) -> None:
        """Encode one frame of FFmpeg's."""
        if self._yuv:
            image = image.reformat(
                format=self._yuv, dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG
            )
        image.pts = self._frames
        image.time_base = self._time_base
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
    # bitexact: no random identifiers in Matroska and WebM. faststart: an MP4's index goes in front,
    # so that playback starts before the file is loaded.
    options = {"fflags": "+bitexact"}
    if container == "mp4":
        options["movflags"] = "+faststart"
    opened = av.open(str(path), "w", format=container, options=options)
    opened.metadata["comment"] = MARK
    return opened


class _Track:
    """The sound of a file, encoded along with its pictures."""

    def __init__(self, container: Any, name: str, sound: NDArray) -> None:
        self._container = container
        self._sound = sound.astype(np.float32)
        self._encoded = 0  # samples
        self._stream = container.add_stream(
            _AUDIO_CODECS[name], rate=SOUND_RATE, layout="mono", bit_rate=_AUDIO_BIT_RATE
        )

    def encode(self, time: float) -> None:
        """Encode the sound up to a time [s]."""
        while self._encoded < min(time * SOUND_RATE, len(self._sound)):
            block = self._sound[None, self._encoded : self._encoded + _BLOCK_SAMPLES]
            frame = av.AudioFrame.from_ndarray(
                np.ascontiguousarray(block), format="fltp", layout="mono"
            )
            frame.sample_rate = SOUND_RATE
            frame.pts = self._encoded
            frame.time_base = Fraction(1, SOUND_RATE)
            self._container.mux(self._stream.encode(frame))
            self._encoded += _BLOCK_SAMPLES

    def finish(self) -> None:
        """Encode the rest."""
        self.encode(float("inf"))
        self._container.mux(self._stream.encode(None))


def join_clips(
    clips: Sequence[tuple[Path, int]],
    path: Path,
    container: str,
    fps: int,
    sound: NDArray | None = None,
) -> None:
    """Concatenate clips into one file, and add the sound, if any.

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
    sound : float [k], optional
        See `Stream`.
    """
    with open_container(path, container) as output:
        track = target = None
        for clip, first in clips:
            with av.open(str(clip)) as source:
                video = source.streams.video[0]
                if target is None:
                    target = output.add_stream_from_template(video)
                    target.time_base = Fraction(1, fps)
                    track = None if sound is None else _Track(output, container, sound)
                for packet in source.demux(video):
                    if packet.pts is None:  # end of stream
                        continue
                    # exact frame numbers in any time base of the container
                    tick = packet.time_base
                    decoded = packet.pts if packet.dts is None else packet.dts
                    packet.pts, packet.dts = (
                        first + round(time * tick * fps) for time in (packet.pts, decoded)
                    )
                    packet.time_base = Fraction(1, fps)
                    packet.duration = 1
                    packet.stream = target
                    output.mux_one(packet)
                    if track is not None:
                        track.encode(packet.pts / fps)
        if track is not None:
            track.finish()
