"""Videos: what goes in comes out, and what cannot be written is refused before anything is rendered."""

import dataclasses
import itertools
import threading
from pathlib import Path

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence
from unfinished_videos import contents

from ripple_sim.encode import FrameWriter, check_output, default_fps, open_writer
from ripple_sim.encode.clip import Stream
from ripple_sim.encode.output import FORMATS, FRAMES_IN_CLIP, Format, Segments
from ripple_sim.errors import EncodingError, VideoError
from ripple_sim.solver.errors import RippleError

WIDTH, HEIGHT, FPS = 96, 64, 25
ENDINGS = [".mp4", ".webm", ".gif", ".webp", ""]


def frames(count: int) -> list[np.ndarray]:
    """A smooth background in which a bright square moves two pixels a frame."""
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    background = np.stack([60 + column, 40 + 2 * row, np.full_like(row, 90)], axis=-1).astype(np.uint8)
    result = []
    for number in range(count):
        frame = background.copy()
        frame[16:48, 8 + 2 * number : 40 + 2 * number] = (230, 180, 20)
        result.append(frame)
    return result


def write(path: Path, count: int = 12) -> FrameWriter:
    with open_writer(path, width=WIDTH, height=HEIGHT, fps=FPS) as writer:
        for frame in frames(count):
            writer.write(frame)
    return writer


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
@pytest.mark.parametrize("colour", [(200, 40, 40), (40, 200, 40), (40, 40, 200), (255, 255, 255), (0, 0, 0)])
def test_a_plain_colour_survives_bt709(tmp_path, ending, colour):
    path = tmp_path / f"plain{ending}"
    frame = np.full((HEIGHT, WIDTH, 3), colour, dtype=np.uint8)
    with open_writer(path, width=WIDTH, height=HEIGHT, fps=FPS) as writer:
        writer.write(frame)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        image = next(container.decode(video=0))
        assert (stream.codec_context.colorspace, stream.codec_context.color_range) == (1, 1)
        # Converted by hand, so that the tags and the pixels are checked against the standard and not each other.
        y, u, v = (plane.astype(float) for plane in _planes(image))
    luma, blue, red = (y - 16) / 219, (u - 128) / 224, (v - 128) / 224
    r, b = luma + 2 * (1 - 0.2126) * red, luma + 2 * (1 - 0.0722) * blue
    g = (luma - 0.2126 * r - 0.0722 * b) / 0.7152
    assert np.abs(255 * np.array([r, g, b]) - colour).max() <= 4


def _planes(image: av.VideoFrame) -> list[np.ndarray]:
    middle = []
    for plane in image.planes:
        array = np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size)
        middle.append(array[plane.height // 2, plane.width // 2])
    return middle


def test_mp4_is_what_browsers_play(tmp_path):
    path = tmp_path / "clip.mp4"
    write(path)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        assert stream.codec_context.name == "h264"
        assert stream.codec_context.pix_fmt == "yuv420p"
        assert stream.average_rate == FPS
        assert stream.frames == 12
    data = path.read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


@pytest.mark.parametrize("ending", [".mp4", ".webm"])
def test_clips_join_to_one_stream_of_even_pace(tmp_path, ending):
    path, count = tmp_path / f"clip{ending}", 2 * FRAMES_IN_CLIP + 5
    with open_writer(path, width=WIDTH, height=HEIGHT, fps=FPS) as writer:
        for number in range(count):
            writer.write(frames(24)[number % 24])
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        packets = [packet for packet in container.demux(stream) if packet.pts is not None]
        times = sorted(float(packet.pts * packet.time_base) for packet in packets)
        np.testing.assert_allclose(times, np.arange(count) / FPS, atol=6e-4)
        decoded = [packet.dts * packet.time_base for packet in packets]
        assert all(a < b for a, b in itertools.pairwise(decoded))
        assert all(packet.dts <= packet.pts for packet in packets)
        starts = [round(float(packet.pts * packet.time_base) * FPS) for packet in packets if packet.is_keyframe]
        assert starts == [0, FRAMES_IN_CLIP, 2 * FRAMES_IN_CLIP]
    back = read(path)
    assert len(back) == count
    for number in (0, FRAMES_IN_CLIP - 1, FRAMES_IN_CLIP, count - 1):
        assert np.abs(frames(24)[number % 24].astype(float) - back[number]).mean() <= 3


def test_a_webp_repeats_keeps_its_rate_and_its_opacity(tmp_path):
    path = tmp_path / "clip.webp"
    sent = np.zeros((7, HEIGHT, WIDTH, 4), np.uint8)
    for number, frame in enumerate(sent):
        frame[10:40, 10 * number : 10 * number + 20] = (200, 40, 90, 255)
    with open_writer(path, width=WIDTH, height=HEIGHT, fps=30, transparent=True) as writer:
        for frame in sent:
            writer.write(frame)
    with Image.open(path) as image:
        assert (image.n_frames, image.info["loop"]) == (7, 0)
        times = []
        for number, frame in enumerate(ImageSequence.Iterator(image)):
            got = np.asarray(frame.convert("RGBA"))
            np.testing.assert_array_equal(got[..., 3], sent[number][..., 3])
            frame.load()
            times.append(frame.info["duration"])
    assert sum(times) == round(7 * 1000 / 30)
    assert max(times) - min(times) <= 1


def test_transparent_frames_keep_their_opacity_in_a_folder_and_are_refused_elsewhere(tmp_path):
    frame = np.arange(4 * HEIGHT * WIDTH, dtype=np.uint32).astype(np.uint8).reshape(HEIGHT, WIDTH, 4)
    with open_writer(tmp_path / "frames", width=WIDTH, height=HEIGHT, fps=30, transparent=True) as writer:
        writer.write(frame)
    np.testing.assert_array_equal(read(tmp_path / "frames")[0], frame)
    with pytest.raises(VideoError, match=r"clip\.mp4 cannot be transparent; valid is \.webp"):
        check_output(tmp_path / "clip.mp4", WIDTH, HEIGHT, 30, transparent=True)


def test_a_gif_repeats_and_keeps_its_rate(tmp_path):
    path = tmp_path / "clip.gif"
    write(path)
    with Image.open(path) as image:
        assert image.n_frames == 12
        assert image.info["loop"] == 0
        assert image.info["duration"] == 1000 / FPS


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_same_frames_give_the_same_bytes(tmp_path, ending):
    # WIDTH is no multiple of 128, where x264's macroblock tree is not deterministic; it takes a few tries to show.
    contents = set()
    for name in "abcdef":
        path = tmp_path / f"{name}{ending}"
        write(path)
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        contents.add(tuple(file.read_bytes() for file in files))
    assert len(contents) == 1


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_error_while_rendering_leaves_nothing_behind(tmp_path, ending):
    with (
        pytest.raises(ZeroDivisionError),
        open_writer(tmp_path / f"clip{ending}", width=WIDTH, height=HEIGHT, fps=FPS) as writer,
    ):
        for frame in frames(5):
            writer.write(frame)
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


def test_an_error_while_rendering_keeps_the_video_that_was_there(tmp_path):
    path = tmp_path / "clip.mp4"
    path.write_bytes(b"yesterday's")
    with (
        pytest.raises(ZeroDivisionError),
        open_writer(path, width=WIDTH, height=HEIGHT, fps=FPS, overwrite=True) as writer,
    ):
        writer.write(frames(1)[0])
        raise ZeroDivisionError
    assert path.read_bytes() == b"yesterday's"
    assert list(tmp_path.iterdir()) == [path]


def test_parent_folders_are_made_and_old_frames_replaced(tmp_path):
    path = tmp_path / "new" / "deeper" / "frames"
    write(path, count=5)
    write(path, count=3)
    assert [name.name for name in sorted(path.iterdir())] == [f"frame_{i:05d}.png" for i in range(3)]
    assert list(path.parent.iterdir()) == [path]


def test_a_frame_may_be_overwritten_after_it_was_handed_over(tmp_path):
    path = tmp_path / "frames"
    buffer = np.empty((HEIGHT, WIDTH, 3), dtype=np.uint8)
    with open_writer(path, width=WIDTH, height=HEIGHT, fps=FPS) as writer:
        for level in range(20):
            buffer[:] = level
            writer.write(buffer)
    assert [int(image.max()) for image in read(path)] == list(range(20))


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
    writer = open_writer(tmp_path / "clip.mp4", width=WIDTH, height=HEIGHT, fps=FPS)
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


def test_an_error_of_the_encoder_reaches_the_caller(tmp_path, gate):
    gate.open.set()
    gate._fails_at = 3
    with (
        pytest.raises(EncodingError, match=r"clip\.mp4: no space left"),
        open_writer(tmp_path / "clip.mp4", width=WIDTH, height=HEIGHT, fps=FPS) as writer,
    ):
        for _ in range(1000):  # more than the queue holds: it must not block for ever
            writer.write(frames(1)[0])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("fails_at", [0, 3, 4, 6])
def test_after_an_error_of_the_encoder_whole_segments_can_be_resumed(tmp_path, gate, fails_at):
    gate.open.set()
    gate._fails_at = fails_at
    (tmp_path / "clip.mp4").touch()
    size = {"width": WIDTH, "height": HEIGHT, "fps": FPS}
    with pytest.raises(EncodingError), open_writer(tmp_path / "clip.mp4", **size, settings={"a": 1}) as writer:
        for _ in range(100):
            writer.write(frames(1)[0])
    assert (tmp_path / "clip.mp4").read_bytes() == b""
    gate._fails_at = None
    with open_writer(tmp_path / "clip.mp4", **size, settings={"a": 1}, resume=True) as writer:
        assert writer.frames == fails_at // 4 * 4
        writer.write(frames(1)[0])


def test_an_error_while_joining_leaves_the_older_video_and_every_segment(tmp_path, gate, monkeypatch):
    def torn(segments: Segments, path: Path, stream: Stream) -> None:
        path.write_text("half")
        raise OSError(28, "No space left on device")

    gate.open.set()
    monkeypatch.setitem(FORMATS, ".mp4", dataclasses.replace(FORMATS[".mp4"], join=torn))
    (tmp_path / "clip.mp4").write_bytes(b"older")
    size = {"width": WIDTH, "height": HEIGHT, "fps": FPS, "settings": {"a": 1}}
    with (
        pytest.raises(EncodingError, match="No space"),
        open_writer(tmp_path / "clip.mp4", **size, overwrite=True) as w,
    ):
        for _ in range(5):
            w.write(frames(1)[0])
    assert (tmp_path / "clip.mp4").read_bytes() == b"older"
    with open_writer(tmp_path / "clip.mp4", **size, resume=True, overwrite=True) as writer:
        assert writer.frames == 5
        writer.discard()


def test_the_time_spent_encoding_is_recorded(tmp_path):
    assert write(tmp_path / "clip.mp4").encode_seconds > 0


@pytest.mark.parametrize(
    "frame",
    [np.zeros((WIDTH, HEIGHT, 3), np.uint8), np.zeros((HEIGHT, WIDTH, 4), np.uint8), np.zeros((HEIGHT, WIDTH, 3))],
)
def test_a_frame_of_another_shape_or_type_is_refused(tmp_path, frame):
    with (
        pytest.raises(VideoError, match="uint8"),
        open_writer(tmp_path / "clip.mp4", width=WIDTH, height=HEIGHT, fps=FPS) as writer,
    ):
        writer.write(frame)
    assert list(tmp_path.iterdir()) == []


def test_a_video_without_frames_is_refused(tmp_path):
    with pytest.raises(VideoError, match="no frame"):
        open_writer(tmp_path / "clip.mp4", width=WIDTH, height=HEIGHT, fps=FPS).close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "size", "fps", "message"),
    [
        ("clip.avi", (1280, 720), 60, r"\.avi.*valid is \.mp4, \.webm, \.gif, \.webp"),
        (".mp4", (1280, 720), 60, r"\.mp4', which is not a file name"),
        ("clip.", (1280, 720), 60, r"ends in \.; valid"),
        ("..", (1280, 720), 60, "valid is .mp4"),
        ("clip.mp4", (1281, 720), 60, "1281x720.*even.*1282x720"),
        ("clip.webm", (1280, 719), 60, "1280x719.*even.*1280x720"),
        ("clip.gif", (0, 720), 25, "0x720.*valid is 16"),
        ("clip.mp4", (1280, 100000), 60, "1280x100000.*to 8192"),
        ("clip.mp4", (1280, 720), 0, "rate is 0.*1 to 240"),
        ("clip.mp4", (1280, 720), 1000, "rate is 1000.*1 to 240"),
        ("clip.gif", (1280, 720), 60, "GIF.*60.*1 to 50"),
        ("a_file", (1280, 720), 60, "is not a folder"),
        ("a_folder.mp4", (1280, 720), 60, "is a folder"),
        ("photos", (1280, 720), 60, r"other files \(me\.jpg\)"),
    ],
)
def test_what_cannot_be_written_is_refused_beforehand(tmp_path, name, size, fps, message):
    (tmp_path / "a_file").write_text("mine")
    (tmp_path / "a_folder.mp4").mkdir()
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "me.jpg").touch()
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(VideoError, match=message) as refusal:
        check_output(tmp_path / name, *size, fps)
    assert isinstance(refusal.value, RippleError)
    assert "\n" not in str(refusal.value)
    assert sorted(tmp_path.rglob("*")) == before


def test_an_odd_size_is_fine_where_colour_is_not_subsampled(tmp_path):
    for name in ("clip.gif", "frames"):
        path = tmp_path / name
        with open_writer(path, width=33, height=17, fps=10) as writer:
            writer.write(np.zeros((17, 33, 3), np.uint8))
        assert read(path)[0].shape == (17, 33, 3)


def test_checking_leaves_nothing_behind(tmp_path):
    check_output(tmp_path / "new" / "clip.mp4", 1280, 720, 60)
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "a_file").touch()
    for place in ("/proc", tmp_path / "a_file"):
        with pytest.raises(EncodingError, match=f"cannot write {place}"):
            check_output(Path(place) / "clip.mp4", 1280, 720, 60)


def test_the_usual_rate_depends_on_the_format():
    assert default_fps(Path("clip.mp4")) == 60
    assert default_fps(Path("clip.gif")) <= 50


def test_without_settings_nothing_survives_an_interruption_and_with_them_it_goes_on(tmp_path: Path) -> None:
    frame = np.full((16, 24, 3), 77, np.uint8)
    for settings, left in ((None, []), ({"the scene": "a"}, ["frames.part"])):
        with (
            pytest.raises(KeyboardInterrupt),
            open_writer(tmp_path / "frames", width=24, height=16, fps=25, settings=settings) as writer,
        ):
            writer.write(frame)
            while not writer._part.frames:
                writer._encoder._thread.join(0.001)
            raise KeyboardInterrupt
        assert [path.name for path in tmp_path.iterdir()] == left
    with open_writer(
        tmp_path / "frames", width=24, height=16, fps=25, settings={"the scene": "a"}, resume=True
    ) as writer:
        assert writer.frames == 1
        writer.write(frame)
    assert sorted(contents(tmp_path)) == ["frames/frame_00000.png", "frames/frame_00001.png"]


def test_a_file_in_the_place_of_a_parent_folder_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(EncodingError, match=r"cannot write .*file/clip\.mp4: Not a directory"):
        open_writer(tmp_path / "file" / "clip.mp4", width=24, height=16, fps=25)
    assert (tmp_path / "file").read_text() == "mine"
