"""Videos: frames come out as they went in; what cannot be written is refused early."""

import dataclasses
import threading
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence

from ripple_sim.encode import FORMATS, Format, Segments, Stream, open_writer
from ripple_sim.encode.writer import QUEUE_FRAMES
from ripple_sim.errors import EncodingError, SimulationError, VideoError

WIDTH = 96
HEIGHT = 64
FPS = 25
SIZE = {"width": WIDTH, "height": HEIGHT, "fps": FPS}
ENDINGS = [".mp4", ".webm", ".gif", ".webp", ""]


def frames(count: int) -> list[np.ndarray]:
    """A smooth background in which a bright square moves two pixels a frame."""
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    background = np.stack([60 + column, 40 + 2 * row, np.full_like(row, 90)], axis=-1).astype(
        np.uint8
    )
    result = []
    for number in range(count):
        frame = background.copy()
        frame[16:48, 8 + 2 * number : 40 + 2 * number] = (230, 180, 20)
        result.append(frame)
    return result


def write(path: Path) -> None:
    with open_writer(path, **SIZE) as writer:
        for frame in frames(12):
            writer.write(frame)


def read(path: Path) -> list[np.ndarray]:
    if path.is_dir():
        return [np.asarray(Image.open(name)) for name in sorted(path.iterdir())]
    if path.suffix == ".webp":
        with Image.open(path) as image:
            return [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(image)]
    with av.open(str(path)) as container:
        return [image.to_ndarray(format="rgb24") for image in container.decode(video=0)]


@pytest.mark.parametrize("ending", ENDINGS)
def test_frames_come_back_in_order_and_in_their_colours(tmp_path, ending):
    path = tmp_path / f"clip{ending}"
    write(path)
    back = read(path)
    assert len(back) == 12
    largest = {".mp4": 3.0, ".webm": 3.0, ".gif": 6.0, ".webp": 3.0, "": 0.0}[ending]
    for sent, got in zip(frames(12), back, strict=True):
        assert got.shape == (HEIGHT, WIDTH, 3)
        assert np.abs(sent.astype(float) - got).mean() <= largest


@pytest.mark.parametrize("ending", [".mp4", ".webm"])
@pytest.mark.parametrize(
    "colour", [(200, 40, 40), (40, 200, 40), (40, 40, 200), (255, 255, 255), (0, 0, 0)]
)
def test_a_plain_colour_survives_bt709(tmp_path, ending, colour):
    path = tmp_path / f"plain{ending}"
    with open_writer(path, **SIZE) as writer:
        writer.write(np.full((HEIGHT, WIDTH, 3), colour, dtype=np.uint8))
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        image = next(container.decode(video=0))
        assert (stream.codec_context.colorspace, stream.codec_context.color_range) == (1, 1)
        # Converted by hand, so that the tags and the pixels are checked against the standard and
        # not each other.
        y, u, v = (
            float(
                np.frombuffer(plane, np.uint8).reshape(plane.height, -1)[
                    plane.height // 2, plane.width // 2
                ]
            )
            for plane in image.planes
        )
    luma = (y - 16) / 219
    blue = (u - 128) / 224
    red = (v - 128) / 224
    r = luma + 2 * (1 - 0.2126) * red
    b = luma + 2 * (1 - 0.0722) * blue
    g = (luma - 0.2126 * r - 0.0722 * b) / 0.7152
    assert np.abs(255 * np.array([r, g, b]) - colour).max() <= 4


def test_mp4_is_what_browsers_play(tmp_path):
    path = tmp_path / "clip.mp4"
    write(path)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.average_rate, stream.frames) == (FPS, 12)
    data = path.read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_transparent_frames_keep_their_opacity_in_a_folder(tmp_path):
    frame = (
        np.arange(4 * HEIGHT * WIDTH, dtype=np.uint32).astype(np.uint8).reshape(HEIGHT, WIDTH, 4)
    )
    with open_writer(tmp_path / "frames", **SIZE, transparent=True) as writer:
        writer.write(frame)
    np.testing.assert_array_equal(read(tmp_path / "frames")[0], frame)


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_same_frames_give_the_same_bytes(tmp_path, ending):
    # WIDTH is no multiple of 128, where x264's macroblock tree is not deterministic; it takes a few
    # tries to show.
    contents = set()
    for name in "abcdef":
        path = tmp_path / f"{name}{ending}"
        write(path)
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        contents.add(tuple(file.read_bytes() for file in files))
    assert len(contents) == 1


@pytest.mark.parametrize("settings", [None, {"a": 1}])
@pytest.mark.parametrize("ending", ENDINGS)
def test_an_error_while_rendering_leaves_nothing_but_the_video_that_was_there(
    tmp_path, ending, settings
):
    """A job that would fail again leaves nothing to resume.

    Without settings nobody knows the job that a part belongs to.
    """
    older = [tmp_path / "clip.mp4"] if ending == ".mp4" else []
    for path in older:
        path.write_bytes(b"yesterday's")
    error = SimulationError if settings else KeyboardInterrupt
    path = tmp_path / f"clip{ending}"
    with (
        pytest.raises(error),
        open_writer(path, **SIZE, settings=settings, overwrite=True) as writer,
    ):
        for frame in frames(QUEUE_FRAMES + 2):  # more than can wait: of single images one is stored
            writer.write(frame)
        raise error
    assert list(tmp_path.iterdir()) == older
    assert all(path.read_bytes() == b"yesterday's" for path in older)


def test_a_frame_may_be_overwritten_after_it_was_handed_over(tmp_path):
    buffer = np.empty((HEIGHT, WIDTH, 3), dtype=np.uint8)
    with open_writer(tmp_path / "frames", **SIZE) as writer:
        for level in range(20):
            buffer[:] = level
            writer.write(buffer)
    assert [int(image.max()) for image in read(tmp_path / "frames")] == list(range(20))


class Gate:
    """A segment that waits to be let through, and fails at one frame."""

    def __init__(self, fails_at: int | None = None) -> None:
        self.open = threading.Event()
        self.seen = 0
        self._fails_at = fails_at

    def start(self, path: Path, stream: Stream) -> "Gate":
        path.touch()
        return self

    def write(self, frame: np.ndarray) -> None:
        self.open.wait(timeout=30)
        if self.seen == self._fails_at:
            raise OSError("no space left on device")
        self.seen += 1

    def finish(self) -> None:
        pass

    def close(self) -> None:
        pass


@pytest.fixture
def gate(monkeypatch) -> Gate:
    gate = Gate()
    join = lambda segments, path, stream: path.touch()  # noqa: E731
    monkeypatch.setitem(FORMATS, ".mp4", Format(suffix=".x", length=4, start=gate.start, join=join))
    return gate


def test_rendering_waits_for_a_slow_encoder(tmp_path, gate):
    writer = open_writer(tmp_path / "clip.mp4", **SIZE)
    frame = frames(1)[0]

    def render() -> None:
        for _ in range(100):
            writer.write(frame)

    renderer = threading.Thread(target=render, daemon=True)
    renderer.start()
    renderer.join(timeout=0.5)
    assert renderer.is_alive()
    assert writer.frames <= 10
    gate.open.set()
    renderer.join(timeout=30)
    writer.close()
    assert gate.seen == writer.frames == 100
    assert list(tmp_path.iterdir()) == [tmp_path / "clip.mp4"]


@pytest.mark.parametrize("fails_at", [0, 3, 4, 6])
def test_after_an_error_of_the_encoder_whole_segments_can_be_resumed(tmp_path, gate, fails_at):
    gate.open.set()
    gate._fails_at = fails_at
    path = tmp_path / "clip.mp4"
    options = {**SIZE, "settings": {"a": 1}}
    path.touch()
    with (
        pytest.raises(EncodingError, match=r"clip\.mp4: no space left"),
        open_writer(path, **options) as writer,
    ):
        for _ in range(1000):  # more than the queue holds: it must not block for ever
            writer.write(frames(1)[0])
    assert path.read_bytes() == b""
    gate._fails_at = None
    with open_writer(path, **options, resume=True) as writer:
        assert writer.frames == fails_at // 4 * 4
        writer.write(frames(1)[0])


def test_an_error_while_joining_leaves_the_older_video_and_every_segment(
    tmp_path, gate, monkeypatch
):
    def torn(segments: Segments, path: Path, stream: Stream) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device")

    gate.open.set()
    monkeypatch.setitem(FORMATS, ".mp4", dataclasses.replace(FORMATS[".mp4"], join=torn))
    path = tmp_path / "clip.mp4"
    options = {**SIZE, "settings": {"a": 1}, "overwrite": True}
    path.write_bytes(b"older")
    with pytest.raises(EncodingError, match="No space"), open_writer(path, **options) as writer:
        for _ in range(5):
            writer.write(frames(1)[0])
    assert path.read_bytes() == b"older"
    with open_writer(path, **options, resume=True) as writer:
        assert writer.frames == 5
        writer.discard()


@pytest.mark.parametrize(
    "frame",
    [
        np.zeros((WIDTH, HEIGHT, 3), np.uint8),
        np.zeros((HEIGHT, WIDTH, 4), np.uint8),
        np.zeros((HEIGHT, WIDTH, 3)),
    ],
)
def test_a_frame_of_another_shape_or_type_is_refused(tmp_path, frame):
    with (
        pytest.raises(VideoError, match="uint8"),
        open_writer(tmp_path / "clip.mp4", **SIZE) as writer,
    ):
        writer.write(frame)
    assert list(tmp_path.iterdir()) == []


def test_a_video_without_frames_is_refused(tmp_path):
    with pytest.raises(VideoError, match="no frame"):
        open_writer(tmp_path / "clip.mp4", **SIZE).close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["clip.gif", "frames"])
def test_an_odd_size_is_fine_where_colour_is_not_subsampled(tmp_path, name):
    with open_writer(tmp_path / name, width=33, height=17, fps=10) as writer:
        writer.write(np.zeros((17, 33, 3), np.uint8))
    assert read(tmp_path / name)[0].shape == (17, 33, 3)
