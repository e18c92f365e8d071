"""The record of an interrupted video tells whether it may go on.

Finished files and folders take their place whole.
"""

from pathlib import Path

import pytest

from ripple_sim.encode.replace import STATES, Record
from ripple_sim.errors import VideoError

VIDEO = Path("clip.mp4")


@pytest.fixture
def record(tmp_path: Path) -> Record:
    return Record(VIDEO, tmp_path)


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
