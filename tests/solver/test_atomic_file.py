"""Files appear complete or not at all."""

import os
from pathlib import Path

import pytest

from ripple_sim.solver.files import OF_THE_NAME, atomic_write, final_path


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def test_a_file_appears_at_the_end_and_nothing_else_stays(tmp_path: Path) -> None:
    path = tmp_path / "new" / "folders" / "a.bin"
    with atomic_write(path) as unfinished:
        unfinished.write_bytes(b"whole")
        assert not path.exists()
        assert unfinished.parent == path.parent  # on the same file system, so that renaming is one step
    assert path.read_bytes() == b"whole"
    assert names(path.parent) == ["a.bin"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_old_file_stays_as_it_was_where_writing_fails(tmp_path: Path, error: type[BaseException]) -> None:
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")

    def write() -> None:
        with atomic_write(path) as unfinished:
            unfinished.write_bytes(b"half of the n")
            raise error

    with pytest.raises(error):
        write()
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["a.bin"]


def test_a_file_replaces_an_old_one(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    for content in (b"old", b"new"):
        with atomic_write(path) as unfinished:
            unfinished.write_bytes(content)
    assert path.read_bytes() == b"new"


def test_the_file_behind_a_symbolic_link_is_written_and_the_link_stays(tmp_path: Path) -> None:
    target, link = tmp_path / "there" / "a.bin", tmp_path / "link.bin"
    target.parent.mkdir()
    target.write_bytes(b"old")
    link.symlink_to(target)
    with atomic_write(link) as unfinished:
        unfinished.write_bytes(b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    assert names(target.parent) == ["a.bin"]


@pytest.mark.parametrize("kind", ["folder", "pipe"])
def test_what_is_not_a_regular_file_is_refused_and_left_alone(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "taken"
    path.mkdir() if kind == "folder" else os.mkfifo(path)
    with pytest.raises(FileExistsError, match="not a regular file"), atomic_write(path):
        pytest.fail("nothing may be written")
    assert names(tmp_path) == ["taken"]
    assert not path.is_file()


def test_nothing_written_is_an_error_and_no_empty_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "a.bin"):
        pass
    assert names(tmp_path) == []


@pytest.mark.parametrize("kind", ["circle", "long"])
def test_a_name_that_cannot_be_written_is_refused_before_anything_is(tmp_path: Path, kind: str) -> None:
    path = tmp_path / (250 * "a" if kind == "long" else "circle")
    if kind == "circle":
        path.symlink_to("other")
        (tmp_path / "other").symlink_to("circle")
    with pytest.raises(OSError, match=r"too long|symbolic links") as refusal:
        final_path(path)
    assert refusal.value.errno in OF_THE_NAME
    with pytest.raises(OSError, match=r"too long|symbolic links"), atomic_write(path):
        pytest.fail("nothing may be written")


def test_a_link_to_what_is_not_there_yet_is_followed(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("folder/new")
    assert final_path(tmp_path / "link") == tmp_path.resolve() / "folder" / "new"
