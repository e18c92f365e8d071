"""GIF with one palette made for the whole animation.

The palette depends on every frame, so the frames are first stored losslessly, and then read twice: to choose the
colours, and to draw with them. Memory does not grow with the length of the video.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
from av.filter import Graph

from .clip import GIF, Clip, Stream
from .mark import mark_gif

# Ordered dithering is the same from frame to frame: it does not shimmer, and it compresses well.
_PALETTE_USE = "dither=bayer:bayer_scale=4:diff_mode=rectangle"


def join_gif(clips: Sequence[tuple[Path, int]], path: Path, stream: Stream) -> None:
    """Make an endlessly looping GIF of clips, given with the number of each one's first frame."""
    palette = _choose_palette(clips, stream)
    gif = Clip(path, GIF, stream)
    try:
        for image in _draw(clips, palette, stream):
            gif.encode(image)
    except BaseException:
        gif.close()
        raise
    gif.finish()
    mark_gif(path)


def _images(clips: Sequence[tuple[Path, int]], fps: int) -> Iterator[av.VideoFrame]:
    for clip, first in clips:
        with av.open(str(clip)) as container:
            for number, image in enumerate(container.decode(video=0)):
                image = image.reformat(format="rgb24")
                image.pts, image.time_base = first + number, Fraction(1, fps)
                yield image


def _choose_palette(clips: Sequence[tuple[Path, int]], stream: Stream) -> av.VideoFrame:
    graph = Graph()
    frames = _source(graph, "rgb24", stream.width, stream.height, stream.fps)
    sink = graph.add("buffersink")
    graph.link_nodes(frames, graph.add("palettegen"), sink).configure()
    for image in _images(clips, stream.fps):
        frames.push(image)
    frames.push(None)
    return sink.pull()


def _draw(clips: Sequence[tuple[Path, int]], palette: av.VideoFrame, stream: Stream) -> Iterator[av.VideoFrame]:
    graph = Graph()
    frames = _source(graph, "rgb24", stream.width, stream.height, stream.fps)
    colours = _source(graph, palette.format.name, palette.width, palette.height, stream.fps)
    draw, sink = graph.add("paletteuse", _PALETTE_USE), graph.add("buffersink")
    frames.link_to(draw, 0, 0)
    colours.link_to(draw, 0, 1)
    draw.link_to(sink)
    graph.configure()
    colours.push(palette)
    colours.push(None)
    for image in _images(clips, stream.fps):
        frames.push(image)
        yield from _ready(sink)
    frames.push(None)
    yield from _ready(sink)


def _source(graph: Graph, pixel_format: str, width: int, height: int, fps: int) -> Any:
    return graph.add_buffer(
        width=width, height=height, format=av.VideoFormat(pixel_format, width, height), time_base=Fraction(1, fps)
    )


def _ready(sink: Any) -> Iterator[av.VideoFrame]:
    while True:
        try:
            yield sink.pull()
        except (av.BlockingIOError, av.EOFError):
            return
