"""The record of an interrupted video tells whether it may go on.

Finished files and folders take their place whole.
"""

from pathlib import Path

import pytest

from ripple_sim.encode.replace import SETTINGS, STATES, Record, move
from ripple_sim.errors import VideoError

VIDEO = Path("clip.mp4")


@pytest.fixture
def record(tmp_path: Path) -> Record:
    return Record(VIDEO, tmp_path)


def test_a_video_can_be_continued_from_its_start_until_it_is_forgotten(record: Record, tmp_path: Path) -> None:
    assert not record.exists
    record.forget()  # of nothing
    record.start({"the size": "64x48"})
    assert record.exists
    assert [path.name for path in tmp_path.iterdir()] == [SETTINGS]
    record.forget()
    assert not record.exists


@pytest.mark.parametrize("settings", [{}, {"the size": "64x48", "the duration": 0.1, "µ": "ü"}, {"pair": (1, 2.5)}])
def test_the_same_settings_may_go_on(record: Record, settings: dict) -> None:
    record.start(settings)
    record.compare(dict(reversed(settings.items())))


@pytest.mark.parametrize(
    ("now", "message"),
    [
        ({"a": 1, "b": 3}, "b was 2 and now is 3"),
        ({"a": 1}, "b was 2 and now is None"),
        ({"a": 1, "b": 2, "c": True}, "c was None and now is True"),
        ({"a": 0, "b": 0}, "a was 1 and now is 0"),
        ({"a": "1", "b": 2}, "a was 1 and now is 1"),
    ],
)
def test_the_first_setting_that_differs_is_named(record: Record, now: dict, message: str) -> None:
    record.start({"b": 2, "a": 1})
    with pytest.raises(VideoError, match=rf"cannot resume clip\.mp4: {message}; .*--resume"):
        record.compare(now)
    record.compare({"a": 1, "b": 2})  # as before the refusal


def test_fingerprints_are_read_again_by_frame(record: Record, tmp_path: Path) -> None:
    assert record.states() == {}
    known: dict[int, str] = {}
    for frame, digest in ((0, "00ff"), (16, "abc"), (100000, "0")):
        record.check_state(known, frame, digest)
    assert known == {0: "00ff", 16: "abc", 100000: "0"}
    assert Record(VIDEO, tmp_path).states() == known


def test_a_known_fingerprint_is_compared_and_not_written_again(record: Record, tmp_path: Path) -> None:
    known: dict[int, str] = {}
    record.check_state(known, 3, "aa")
    before = (tmp_path / STATES).read_bytes()
    record.check_state(known, 3, "aa")
    with pytest.raises(VideoError, match=r"cannot resume clip\.mp4: at frame 3 .*leave --resume out"):
        record.check_state(known, 3, "ab")
    assert (tmp_path / STATES).read_bytes() == before
    assert known == {3: "aa"}


@pytest.mark.parametrize("kept", range(len("\n16 cdef;\n")))
def test_a_line_cut_off_anywhere_spoils_neither_its_neighbours_nor_the_next(
    record: Record, tmp_path: Path, kept: int
) -> None:
    record.check_state({}, 8, "0123")
    record.check_state({}, 16, "cdef")
    whole = (tmp_path / STATES).read_bytes()
    (tmp_path / STATES).write_bytes(whole[: len(whole) - 10 + kept])
    known = record.states()
    assert known == ({8: "0123", 16: "cdef"} if kept == len("\n16 cdef;") else {8: "0123"})
    record.check_state(known, 24, "99")
    assert record.states() == known


def test_a_moved_file_replaces_the_one_in_its_place(tmp_path: Path) -> None:
    (tmp_path / "new").write_bytes(b"new")
    (tmp_path / "old").write_bytes(b"old and longer")
    move(tmp_path / "new", tmp_path / "old")
    assert (tmp_path / "old").read_bytes() == b"new"
    assert [path.name for path in tmp_path.iterdir()] == ["old"]


def test_a_folder_moves_with_all_its_files(tmp_path: Path) -> None:
    source = tmp_path / "frames"
    source.mkdir()
    for number in range(3):
        (source / f"{number}").write_text(str(number))
    move(source, tmp_path / "video")
    assert {path.name: path.read_text() for path in (tmp_path / "video").iterdir()} == {"0": "0", "1": "1", "2": "2"}
    assert not source.exists()


def test_a_folder_never_replaces_one_that_is_not_empty(tmp_path: Path) -> None:
    for name in ("frames", "video"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "mine").write_text(name)
    with pytest.raises(OSError, match="not empty"):
        move(tmp_path / "frames", tmp_path / "video")
    assert (tmp_path / "video" / "mine").read_text() == "video"
    assert (tmp_path / "frames" / "mine").read_text() == "frames"


def test_what_is_missing_harms_nothing_in_its_place(tmp_path: Path) -> None:
    (tmp_path / "old").write_text("old")
    with pytest.raises(FileNotFoundError):
        move(tmp_path / "missing", tmp_path / "old")
    assert (tmp_path / "old").read_text() == "old"
