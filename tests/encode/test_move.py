"""Finished files and folders take their place whole."""

from pathlib import Path

import pytest

from ripple_sim.encode.replace import move


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
