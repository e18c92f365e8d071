"""The encoder's thread: whole segments are stored in order, and an error neither blocks nor publishes anything."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.encode.clip import Stream
from ripple_sim.encode.output import Format, Segments
from ripple_sim.encode.part import Part
from ripple_sim.encode.writer import QUEUE_FRAMES, Encoder

STREAM, LENGTH = Stream(1, 1, 25), 3


class Digits:
    """A segment of text: each frame is its only number."""

    closed: list[Path]

    def __init__(self, path: Path, stream: Stream) -> None:
        self._path, self._numbers = path, []
        path.touch()

    def write(self, frame: np.ndarray) -> None:
        if frame.size == 0:
            raise OSError(28, "No space left on device")
        self._numbers.append(int(frame[0]))

    def finish(self) -> None:
        self._path.write_text(" ".join(map(str, self._numbers)))

    def close(self) -> None:
        Digits.closed.append(self._path)


def join(segments: Segments, path: Path, stream: Stream) -> None:
    path.write_text("; ".join(f"{first}: {segment.read_text()}" for segment, first in segments))


def torn(segments: Segments, path: Path, stream: Stream) -> None:
    path.write_text("half")
    raise OSError(28, "No space left on device")


@pytest.fixture(autouse=True)
def _none_closed() -> None:
    Digits.closed = []


@pytest.fixture
def part(tmp_path: Path) -> Iterator[Part]:
    made = Part(tmp_path / "video", suffix=".txt", length=LENGTH, settings={}, resume=False)
    yield made
    if made.folder.exists():
        made.remove()


def digits(join_with: object = join) -> Format:
    return Format(suffix=".txt", length=LENGTH, start=Digits, join=join_with)


def stored(part: Part) -> list[str]:
    return [path.read_text() for path, _ in part.segments()]


@pytest.mark.parametrize(
    ("count", "whole"),
    [(1, "0: 0"), (3, "0: 0 1 2"), (4, "0: 0 1 2; 3: 3"), (7, "0: 0 1 2; 3: 3 4 5; 6: 6")],
)
def test_frames_are_joined_in_order_from_whole_segments_and_a_shorter_last_one(
    part: Part, count: int, whole: str
) -> None:
    encoder = Encoder(part, digits(), STREAM)
    for number in range(count):
        encoder.put(np.array([number]))
    encoder.stop()
    assert encoder.error is None
    assert encoder.finished
    assert not encoder.running
    assert part.video.read_text() == whole
    assert not part.folder.exists()
    encoder.stop()  # again: nothing


def test_without_joining_the_folder_of_segments_is_the_video(part: Part) -> None:
    encoder = Encoder(part, digits(None), STREAM)
    for number in range(5):
        encoder.put(np.array([number]))
    encoder.stop()
    texts = {path.name: path.read_text() for path in part.video.iterdir()}
    assert texts == {"frames_00000-00002.txt": "0 1 2", "frames_00003-00004.txt": "3 4"}


def test_an_abandoned_video_is_not_published_and_keeps_whole_segments_alone(part: Part) -> None:
    part.video.write_text("older")
    encoder = Encoder(part, digits(), STREAM)
    for number in range(LENGTH):
        encoder.put(np.array([number]))
    while not part.frames:  # until the thread has stored the segment
        encoder._thread.join(0.001)
    encoder.put(np.array([9]))
    encoder.abandon()
    assert not encoder.finished
    assert not encoder.running
    assert encoder.error is None
    assert stored(part) == ["0 1 2"]
    assert part.video.read_text() == "older"


@pytest.mark.parametrize("fails_at", [0, 2, 3, 5])
def test_an_error_is_kept_and_what_follows_is_dropped_without_blocking(part: Part, fails_at: int) -> None:
    part.video.write_text("older")
    encoder = Encoder(part, digits(), STREAM)
    for number in range(fails_at):
        encoder.put(np.array([number]))
    encoder.put(np.empty(0))
    for number in range(3 * QUEUE_FRAMES):  # more than the queue holds
        encoder.put(np.array([number]))
    encoder.stop()
    assert isinstance(encoder.error, OSError)
    assert not encoder.finished
    assert Digits.closed == [part.unfinished]
    assert stored(part) == ["0 1 2"] * (fails_at // LENGTH)
    assert part.video.read_text() == "older"


def test_an_error_while_joining_leaves_the_older_video_and_every_segment(part: Part) -> None:
    part.video.write_text("older")
    encoder = Encoder(part, digits(torn), STREAM)
    for number in range(4):
        encoder.put(np.array([number]))
    encoder.stop()
    assert isinstance(encoder.error, OSError)
    assert not encoder.finished
    assert part.video.read_text() == "older"
    assert stored(part) == ["0 1 2", "3"]


def test_a_resumed_video_goes_on_behind_the_stored_segments(tmp_path: Path) -> None:
    for resume, numbers in ((False, range(3)), (True, range(3, 5))):
        part = Part(tmp_path / "video", suffix=".txt", length=LENGTH, settings={}, resume=resume)
        encoder = Encoder(part, digits(), STREAM)
        assert part.frames == numbers[0]
        for number in numbers:
            encoder.put(np.array([number]))
        if resume:
            encoder.stop()
        else:
            while part.frames < LENGTH:
                encoder._thread.join(0.001)
            encoder.abandon()
            assert part.keep()
    assert part.video.read_text() == "0: 0 1 2; 3: 3 4"
    assert [path.name for path in tmp_path.iterdir()] == ["video"]
