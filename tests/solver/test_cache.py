"""The cache deletes the least recently used files first, and no files of other programs."""

import os
import weakref
from pathlib import Path

import numpy as np
import pytest
from genus_zero import icosphere
from programs import PROGRAMS, ended

from ripple_sim.errors import RippleWarning
from ripple_sim.solver import Mesh, RippleError, build_atlas, cache


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return cache.cache_folder()


def keep(name: str, *, age: float, size: int = 1_000_000) -> Path:
    """A file of the cache that was last used so many seconds after 1970."""
    path = cache.cache_path(name, [np.arange(3)])
    path.write_bytes(bytes(size))
    os.utime(path, (age, age))
    return path


def test_the_least_recently_used_file_is_deleted_first_and_the_newest_stays(
    monkeypatch,
) -> None:
    old = keep("old", age=20)
    older = keep("older", age=10)
    newest = keep("newest", age=30)
    monkeypatch.setenv(cache.LIMIT, "2")
    cache.mark_used(older)
    cache.make_room(newest)
    assert list(cache.cached_files()) == [newest, older]
    assert not old.exists()
    made = keep("large", age=5, size=3_000_000)
    cache.make_room(made)
    assert list(cache.cached_files()) == [made]


@pytest.fixture(scope="module")
def ball_mesh() -> Mesh:
    return Mesh.from_arrays(*icosphere(1))


def test_a_cache_limit_of_0_keeps_no_file(monkeypatch, ball_mesh: Mesh) -> None:
    monkeypatch.setenv(cache.LIMIT, "0")
    build_atlas(ball_mesh, 8)
    assert not cache.cached_files()


def test_files_of_other_programs_stay_in_the_cache(folder: Path, monkeypatch) -> None:
    foreign = [folder / "notes.txt", folder / "atlas.npz", folder / f"{'a' * 32}.npz.bak"]
    for path in foreign:
        path.write_bytes(bytes(1000))
    unfinished = folder / f".{'a' * 32}.npz.123.part"
    unfinished.write_bytes(bytes(1000))
    monkeypatch.setenv(cache.LIMIT, "0")
    cache.make_room(folder / "none")
    assert set(folder.iterdir()) == set(foreign)


@pytest.mark.parametrize("limit", ["much", "-1", "nan", "inf"])
def test_a_limit_that_is_no_size_is_refused_before_anything_is_made(
    limit: str, ball_mesh: Mesh, monkeypatch
) -> None:
    monkeypatch.setenv(cache.LIMIT, limit)
    with pytest.raises(
        RippleError, match=f"{cache.LIMIT} must be a number of megabytes.*, got '{limit}'"
    ):
        build_atlas(ball_mesh, 8)


def test_a_file_that_another_process_removes_is_no_error(monkeypatch) -> None:
    newest = keep("newest", age=30)
    listed = cache.cached_files()
    newest.unlink()
    monkeypatch.setattr("ripple_sim.solver.cache.cached_files", lambda: listed)
    monkeypatch.setenv(cache.LIMIT, "0")
    cache.make_room(newest)


@pytest.mark.parametrize("home", [None, "/proc/no/home"])
def test_without_a_home_results_are_kept_in_a_private_folder(
    home: str | None, tmp_path: Path, monkeypatch
) -> None:
    """A service or container whose HOME and passwd entry are missing or invalid."""
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(
        "ripple_sim.solver.cache._private_folder", cache._private_folder.__wrapped__
    )
    if home is None:
        monkeypatch.delenv("HOME", raising=False)
        monkeypatch.setattr("pwd.getpwuid", lambda uid: {}[uid])
    else:
        monkeypatch.setenv("HOME", home)
    with pytest.warns(RippleWarning, match="set XDG_CACHE_HOME"):
        folder = cache.cache_folder()
    assert folder.parent == tmp_path and folder.stat().st_mode & 0o077 == 0


def test_a_private_folder_of_another_user_is_not_used(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    planted = tmp_path / f"ripple-sim-{os.getuid()}"
    planted.mkdir(mode=0o777)
    planted.chmod(0o777)
    with pytest.warns(RippleWarning, match="there is no home"):
        folder = cache._private_folder.__wrapped__("there is no home")
    assert folder != planted and folder.stat().st_mode & 0o077 == 0


def fill_cache(mode: str, home: Path) -> list[str]:
    """Run `fill_cache.py` with a home of its own; return the files that it leaves there."""
    environment = {"XDG_CACHE_HOME": str(home), "PATH": "", "NUMBA_NUM_THREADS": "1"}
    result = ended(PROGRAMS / "fill_cache.py", mode, env=environment, timeout=600)
    assert (result.returncode, result.stderr) == (0, "")
    return [each.name for each in home.rglob("*") if each.is_file()]


def test_four_processes_fill_one_cache_at_once(tmp_path: Path) -> None:
    files = fill_cache("four", tmp_path)
    assert len(files) == 1 and files[0].endswith(".npz")


def test_a_full_disk_costs_the_next_call_its_time_and_leaves_nothing(tmp_path: Path) -> None:
    assert fill_cache("full", tmp_path) == []


def test_a_result_for_an_object_is_computed_once_and_kept_while_the_object_lives():
    class Thing:
        pass

    made = []

    @cache.kept_with
    def make(owner):
        made.append(weakref.ref(result := Thing()))
        return result

    first = Thing()
    second = Thing()
    assert make(first) is make(first)
    assert make(second) is not make(first)
    assert len(made) == 2
    del first
    assert made[0]() is None
    assert made[1]() is make(second)


def test_results_in_memory_are_freed_before_python_ends():
    result = ended(PROGRAMS / "keep_result_until_exit.py")
    assert (result.stdout, result.stderr) == ("freed\n", "")
