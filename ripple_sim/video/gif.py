"""GIF with one palette made for the whole animation.

A palette can be chosen only when every frame has been seen, so the frames go losslessly to a file first, which is then
read twice: to choose the colours, and to draw with them. Memory does not grow with the length of the video.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.filter import Graph
from numpy.typing import NDArray

from .encoders import FileEncoder

# Ordered dithering stays where it is from frame to frame: it does not shimmer, and it packs well.
_PALETTE_USE = "dither=bayer:bayer_scale=4:diff_mode=rectangle"


class GifEncoder:
    """An animated GIF that repeats for ever."""

    def __init__(self, path: Path, width: int, height: int, fps: int) -> None:
        self.path = path
        self._stream: dict[str, Any] = {"width": width, "height": height, "fps": fps}
        self._stored = FileEncoder(
            path.with_name(path.name + ".frames"),
            container="matroska",
            codec="libx264rgb",
            pixel_format="rgb24",
            options={"qp": "0", "preset": "ultrafast"},
            **self._stream,
        )

    def write(self, frame: NDArray[np.uint8]) -> None:
        """Store one frame until all are there."""
        self._stored.write(frame)

    def finish(self) -> None:
        """Choose the palette and write the GIF."""
        self._stored.finish()
        gif = FileEncoder(self.path, container="gif", codec="gif", pixel_format="pal8", options={}, **self._stream)
        for image in self._draw(self._choose_palette()):
            gif.encode(image)
        gif.finish()
        self._stored.path.unlink()

    def discard(self) -> None:
        """Remove the stored frames and the GIF."""
        self._stored.discard()
        self.path.unlink(missing_ok=True)

    def _images(self) -> Iterator[av.VideoFrame]:
        with av.open(str(self._stored.path)) as container:
            for number, image in enumerate(container.decode(video=0)):
                image = image.reformat(format="rgb24")
                image.pts, image.time_base = number, Fraction(1, self._stream["fps"])
                yield image

    def _source(self, graph: Graph, pixel_format: str, width: int, height: int) -> Any:
        return graph.add_buffer(
            width=width,
            height=height,
            format=av.VideoFormat(pixel_format, width, height),
            time_base=Fraction(1, self._stream["fps"]),
        )

    def _choose_palette(self) -> av.VideoFrame:
        graph = Graph()
        frames = self._source(graph, "rgb24", self._stream["width"], self._stream["height"])
        sink = graph.add("buffersink")
        graph.link_nodes(frames, graph.add("palettegen"), sink).configure()
        for image in self._images():
            frames.push(image)
        frames.push(None)
        return sink.pull()

    def _draw(self, palette: av.VideoFrame) -> Iterator[av.VideoFrame]:
        graph = Graph()
        frames = self._source(graph, "rgb24", self._stream["width"], self._stream["height"])
        colours = self._source(graph, palette.format.name, palette.width, palette.height)
        draw, sink = graph.add("paletteuse", _PALETTE_USE), graph.add("buffersink")
        frames.link_to(draw, 0, 0)
        colours.link_to(draw, 0, 1)
        draw.link_to(sink)
        graph.configure()
        colours.push(palette)
        colours.push(None)
        for image in self._images():
            frames.push(image)
            yield from _ready(sink)
        frames.push(None)
        yield from _ready(sink)


def _ready(sink: Any) -> Iterator[av.VideoFrame]:
    while True:
        try:
            yield sink.pull()
        except (av.BlockingIOError, av.EOFError):
            return
