"""Animated GIFs, whose memory does not grow with their length.

A GIF has one palette for the whole animation, which depends on every frame. So the frames are first
stored losslessly, and then read twice: to choose the colours, and to draw with them.
"""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
from av.filter import Graph

from .clip import GIF, Clip, Stream
from .replace import mark_gif

# Ordered dithering is the same from frame to frame: it does not shimmer, and it compresses well.
_PALETTE_USE = "dither=bayer:bayer_scale=4:diff_mode=rectangle"


def join_gif(clips: Sequence[tuple[Path, int]], path: Path, stream: Stream) -> None:
    """Make an endlessly looping GIF of clips, given with the number of each one's first frame."""
    graph = Graph()
    frames = _source(graph, stream)
    sink = graph.add("buffersink")
    graph.link_nodes(frames, graph.add("palettegen"), sink).configure()
    (palette,) = _filtered(_images(clips, stream.fps), frames, sink)
    graph = Graph()
    frames = _source(graph, stream)
    colours = graph.add_buffer(palette, time_base=Fraction(1, stream.fps))
    draw = graph.add("paletteuse", _PALETTE_USE)
    sink = graph.add("buffersink")
    frames.link_to(draw, 0, 0)
    colours.link_to(draw, 0, 1)
    draw.link_to(sink)
    graph.configure()
    colours.push(palette)
    colours.push(None)
    with contextlib.closing(Clip(path, GIF, stream)) as gif:
        for image in _filtered(_images(clips, stream.fps), frames, sink):
            gif.encode(image)
        gif.finish()
    mark_gif(path)


def _source(graph: Graph, stream: Stream) -> Any:
    """The node of a graph at which the frames enter."""
    return graph.add_buffer(
        width=stream.width,
        height=stream.height,
        format=av.VideoFormat("rgb24"),
        time_base=Fraction(1, stream.fps),
    )


def _images(clips: Sequence[tuple[Path, int]], fps: int) -> Iterator[av.VideoFrame]:
    """The frames of all clips."""
    for clip, first in clips:
        with av.open(str(clip)) as container:
            for number, image in enumerate(container.decode(video=0)):
                image = image.reformat(format="rgb24")
                image.pts = first + number
                image.time_base = Fraction(1, fps)
                yield image


def _filtered(images: Iterable[av.VideoFrame], source: Any, sink: Any) -> Iterator[av.VideoFrame]:
    """Images from a filter graph's sink, taken while images enter its source."""
    for image in itertools.chain(images, [None]):
        source.push(image)
        # until the graph wants the next image, or has given its last one
        with contextlib.suppress(av.BlockingIOError, av.EOFError):
            while True:
                yield sink.pull()
