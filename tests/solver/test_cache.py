"""The cache folder: kept under its limit, what was used longest ago first, and nobody else's files touched."""

import os
from pathlib import Path

import numpy as np
import pytest

from ripple_sim.solver import Mesh, RippleError, build_atlas
from ripple_sim.solver.cache import LIMIT, cache_folder, cache_path, cached_files, make_room, mark_used


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    cache_folder().mkdir()
    return cache_folder()


def keep(name: str, *, age: float, size: int = 1_000_000) -> Path:
    """A file of the cache that was last used so many seconds after 1970."""
    path = cache_path(name, [np.arange(3)])
    path.write_bytes(bytes(size))
    os.utime(path, (age, age))
    return path


def test_what_was_used_longest_ago_goes_first(monkeypatch) -> None:
    old, older, newest = keep("old", age=20), keep("older", age=10), keep("newest", age=30)
    monkeypatch.setenv(LIMIT, "2")
    mark_used(older)
    make_room(newest)
    assert [file.path for file in cached_files()] == [newest, older]
    assert not old.exists()


def test_what_has_just_been_made_stays_though_it_is_too_large(monkeypatch) -> None:
    keep("small", age=10)
    newest = keep("large", age=5, size=3_000_000)
    monkeypatch.setenv(LIMIT, "2")
    make_room(newest)
    assert [file.path for file in cached_files()] == [newest]


def test_a_limit_of_zero_keeps_nothing(monkeypatch, ball_mesh: Mesh) -> None:
    monkeypatch.setenv(LIMIT, "0")
    build_atlas(ball_mesh, 8)
    assert not cached_files()


def test_the_files_of_others_stay(folder: Path, monkeypatch) -> None:
    foreign = [folder / "notes.txt", folder / "atlas.npz", folder / f"{'a' * 32}.npz.bak"]
    for path in foreign:
        path.write_bytes(bytes(1000))
    unfinished = folder / f".{'a' * 32}.npz.123.part"
    unfinished.write_bytes(bytes(1000))
    monkeypatch.setenv(LIMIT, "0")
    make_room(folder / "none")
    assert set(folder.iterdir()) == set(foreign)


@pytest.mark.parametrize("limit", ["much", "-1", "nan", "inf"])
def test_a_limit_that_is_no_size_is_refused_before_anything_is_made(limit: str, ball_mesh: Mesh, monkeypatch) -> None:
    monkeypatch.setenv(LIMIT, limit)
    with pytest.raises(RippleError, match=f"{LIMIT} is '{limit}'; valid is a number of megabytes"):
        build_atlas(ball_mesh, 8)


def test_a_file_that_another_process_removes_is_no_error(monkeypatch) -> None:
    newest = keep("newest", age=30)
    listed = cached_files()
    newest.unlink()
    monkeypatch.setattr("ripple_sim.solver.cache.cached_files", lambda: listed)
    monkeypatch.setenv(LIMIT, "0")
    make_room(newest)
