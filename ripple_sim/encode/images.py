"""Files of images: EXR frames, passes, and the animations GIF and WebP, whose memory does not grow with their length.

EXR is linear light in half floats, for compositing and grading. Passes are one file a frame, NumPy's .npz or OpenEXR,
in a folder beside the video. A GIF has one palette for the whole animation, which depends on every frame, so the frames
are first stored losslessly, and then read twice: to choose the colours, and to draw with them. A WebP is assembled from
still images: the container is RIFF, see "WebP Container Specification" by Google: VP8X (size and flags), ANIM
(background, loops), an ANMF chunk per frame with the chunks of a still image, and XMP with the mark.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import itertools
import json
import re
import struct
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.filter import Graph
from numpy.typing import NDArray

from ripple_sim.errors import EncodingError, VideoError
from ripple_sim.solver.files import final_path

from .clip import GIF, Clip, Stream
from .replace import MARK, check_folder, made_here, mark_gif, read_object

_BT709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # ITU-R BT.709: x and y of red, green, blue and white


def check_exr() -> None:
    """Make sure that EXR frames can be written; raises `VideoError` if OpenEXR is not installed."""
    if importlib.util.find_spec("OpenEXR") is None:
        raise VideoError(
            "EXR frames need OpenEXR, which is not installed; install it with: pip install 'ripple-sim[exr]'"
        )


def write_exr(path: Path, frame: NDArray[np.float16], fps: int) -> None:
    """Write a frame, float16 [height, width, 3 or 4], with colours multiplied by opacity."""
    _write_channels(path, {"RGBA"[: frame.shape[2]]: frame}, chromaticities=_BT709, framesPerSecond=Fraction(fps))


def _write_channels(path: Path, channels: Mapping[str, NDArray], **attributes: Any) -> None:
    """Write an EXR file; the same content gives the same bytes."""
    import OpenEXR

    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION, "software": MARK, **attributes}
    # through memory: the library does not notice a disk that fills up with the last bytes of a file
    file = io.BytesIO()
    OpenEXR.File(header, {name: np.ascontiguousarray(values) for name, values in channels.items()}).write(file)
    path.write_bytes(file.getbuffer())


# Ordered dithering is the same from frame to frame: it does not shimmer, and it compresses well.
_PALETTE_USE = "dither=bayer:bayer_scale=4:diff_mode=rectangle"


def join_gif(clips: Sequence[tuple[Path, int]], path: Path, stream: Stream) -> None:
    """Make an endlessly looping GIF of clips, given with the number of each one's first frame."""
    graph = Graph()
    frames, sink = _source(graph, stream), graph.add("buffersink")
    graph.link_nodes(frames, graph.add("palettegen"), sink).configure()
    (palette,) = _filtered(_images(clips, stream.fps), frames, sink)
    graph = Graph()
    frames, colours = _source(graph, stream), graph.add_buffer(palette, time_base=Fraction(1, stream.fps))
    draw, sink = graph.add("paletteuse", _PALETTE_USE), graph.add("buffersink")
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
    width, height, form = stream.width, stream.height, av.VideoFormat("rgb24")
    return graph.add_buffer(width=width, height=height, format=form, time_base=Fraction(1, stream.fps))


def _images(clips: Sequence[tuple[Path, int]], fps: int) -> Iterator[av.VideoFrame]:
    for clip, first in clips:
        with av.open(str(clip)) as container:
            for number, image in enumerate(container.decode(video=0)):
                image = image.reformat(format="rgb24")
                image.pts, image.time_base = first + number, Fraction(1, fps)
                yield image


def _filtered(images: Iterable[av.VideoFrame], source: Any, sink: Any) -> Iterator[av.VideoFrame]:
    """What comes out of a graph's sink, taken at once, while images go in at its source."""
    for image in itertools.chain(images, [None]):
        source.push(image)
        with contextlib.suppress(av.BlockingIOError, av.EOFError):  # until it wants the next image, or is done
            while True:
                yield sink.pull()


PASSES = ("depth", "normal", "segmentation", "flow", "position", "height")
PASS_FORMATS = ("npz", "exr")
_CONTENTS = "segmentation.json"
_NAME = re.compile(rf"passes_\d{{5,}}\.({'|'.join(PASS_FORMATS)})|{re.escape(_CONTENTS)}")
_CHANNELS = {"normal": "XYZ", "position": "XYZ", "flow": "XY"}  # of an EXR; one channel has the pass's own name


class PassFiles:
    """Writes the passes of frames.

    Parameters
    ----------
    video : Path
        Beside which the folder `NAME.passes` stands, NAME without an ending.
    form : str
        One of `PASS_FORMATS`.
    geoms : mapping
        Name of what each number of the segmentation stands for.
    frames : int
        Frames that the video has already, where its render is resumed: their passes stay.
    overwrite : bool
        Replace what `check_passes` would refuse.

    Attributes
    ----------
    complete : int
        The first so many frames have their passes.
    """

    def __init__(
        self, video: Path, form: str, geoms: Mapping[int, str], frames: int = 0, overwrite: bool = False
    ) -> None:
        self._video, self._form, self._geoms, self._overwrite = video, form, geoms, overwrite
        self.folder = passes_folder(video)
        self.complete = 0
        while self.complete < frames and self._path(self.complete).exists():
            self.complete += 1

    def begin(self) -> None:
        """Remove the passes of an earlier run, and say whose come now: before the first frame that has passes.

        Raises `VideoError` if the folder has become another's since `check_passes`, and `EncodingError` if it cannot
        be written.
        """
        _check_folder(self._video, self._overwrite)  # again: to set up a scene takes long
        kept = {self._path(frame) for frame in range(self.complete)}
        owner = {"software": MARK, "video": final_path(self._video).name}
        text = json.dumps({**owner, "geoms": {str(k): name for k, name in self._geoms.items()}}, indent=1)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            for each in {*self.folder.iterdir()} - kept:
                each.unlink()
        except OSError as error:
            raise self._error(error) from error
        self._write(self.folder / _CONTENTS, lambda path: path.write_text(text, encoding="utf-8"))

    def write(self, frame: int, passes: Mapping[str, NDArray]) -> None:
        """Write the passes of a frame, by name, [height, width] or [height, width, 2 or 3].

        Raises `EncodingError` if they cannot be written.
        """
        write = _write_npz if self._form == "npz" else _write_exr
        self._write(self._path(frame), lambda path: write(path, passes))

    def _path(self, frame: int) -> Path:
        return self.folder / f"passes_{frame:05d}.{self._form}"

    def _write(self, path: Path, write: Callable[[Path], object]) -> None:
        unfinished = path.with_name(f".{path.name}")
        try:
            write(unfinished)
            unfinished.replace(path)
        except OSError as error:
            unfinished.unlink(missing_ok=True)
            raise self._error(error) from error

    def _error(self, error: OSError) -> EncodingError:
        return EncodingError(f"cannot write passes to {self.folder}: {error.strerror or error}")


def passes_folder(video: Path) -> Path:
    """Folder of the passes of a video."""
    video = final_path(video)
    return video.with_name(f"{video.stem if video.suffix else video.name}.passes")


def check_passes(video: Path, passes: tuple[str, ...], form: str, overwrite: bool) -> None:
    """Make sure that passes can be written beside a video.

    Raises `VideoError` if there is no such pass or format, OpenEXR is missing, or the folder holds the passes of
    another video or anything that was not made here.
    """
    if unknown := [name for name in passes if name not in PASSES]:
        raise VideoError(f"there is no pass {unknown[0]!r}; valid are {', '.join(PASSES)}")
    if form not in PASS_FORMATS:
        raise VideoError(f"pass format is {form!r}; valid is {' or '.join(map(repr, PASS_FORMATS))}")
    if form == "exr":
        check_exr()
    _check_folder(video, overwrite)


def _check_folder(video: Path, overwrite: bool) -> None:
    """Raise `VideoError` if a video's folder of passes holds another's, or anything that was not made here."""
    folder = passes_folder(video)

    def own(file: Path) -> bool:
        unfinished = file.name.startswith(".")  # a kill left it, perhaps without its mark
        return _NAME.fullmatch(file.name.lstrip(".")) is not None and (unfinished or overwrite or made_here(file))

    check_folder(VideoError, "passes", folder, own)
    owner = read_object(folder / _CONTENTS).get("video")  # None: the folder does not say whose it is
    if owner not in (None, final_path(video).name) and not overwrite:
        raise VideoError(
            f"cannot write passes to {folder}: they are those of {owner}; name another output, or add --overwrite"
        )


def _write_npz(path: Path, passes: Mapping[str, NDArray]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.comment = MARK.encode()
        for name, values in passes.items():
            # the same passes give the same file: without the time of day
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as file:
                np.lib.format.write_array(file, values)


def _write_exr(path: Path, passes: Mapping[str, NDArray]) -> None:
    channels = {}
    for name, values in passes.items():
        for index, axis in enumerate(_CHANNELS.get(name, "")):
            channels[f"{name}.{axis}"] = values[..., index]
        if name not in _CHANNELS:
            channels[name] = values
    _write_channels(path, channels)


_ANIMATION, _METADATA, _OPACITY = 0x02, 0x04, 0x10
_DO_NOT_BLEND = 0x02


def join_webp(stills: Sequence[Path], path: Path, stream: Stream) -> None:
    """Make an endlessly looping WebP of still ones, all of the stream's size."""
    flags = _ANIMATION | _METADATA
    canvas = b"".join((side - 1).to_bytes(3, "little") for side in (stream.width, stream.height))
    with path.open("wb") as file:
        file.write(bytes(12 + 8 + 10))  # RIFF and VP8X, which come last: they hold the size and the flags
        file.write(riff_chunk(b"ANIM", struct.pack("<IH", 0, 0)))
        for number, still in enumerate(stills):
            # whole milliseconds, without accumulating the rounding error
            begin, end = (round(1000 * n / stream.fps) for n in (number, number + 1))
            image = _image_chunks(still.read_bytes())
            if image.startswith(b"ALPH") or (image.startswith(b"VP8L") and image[12] & 0x10):
                flags |= _OPACITY
            header = bytes(6) + canvas + (end - begin).to_bytes(3, "little") + bytes([_DO_NOT_BLEND])
            file.write(riff_chunk(b"ANMF", header + image))
        file.write(riff_chunk(b"XMP ", MARK.encode()))
        size = file.tell()
        file.seek(0)
        file.write(struct.pack("<4sI4s", b"RIFF", size - 8, b"WEBP"))
        file.write(riff_chunk(b"VP8X", struct.pack("<I", flags) + canvas))


def _image_chunks(still: bytes) -> bytes:
    """The chunks of a still WebP that make up its image."""
    at, kept = 12, b""
    while at < len(still):
        name, size = struct.unpack_from("<4sI", still, at)
        end = at + 8 + size + size % 2
        if name in (b"ALPH", b"VP8 ", b"VP8L"):
            kept += still[at:end]
        at = end
    return kept


def riff_chunk(name: bytes, content: bytes) -> bytes:
    """A chunk of a RIFF file, of an even length."""
    return struct.pack("<4sI", name, len(content)) + content + bytes(len(content) % 2)
