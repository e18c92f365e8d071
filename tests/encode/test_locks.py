"""Locks between processes: one holds them, and they end with it."""

import multiprocessing
import os
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from ripple_sim.encode import locks
from ripple_sim.encode.locks import FileLock, locked


def hold(path: Path, ready, done) -> None:
    FileLock(path).acquire()
    ready.set()
    done.wait()
    os._exit(1)


def test_a_lock_is_one_processes_until_that_ends(tmp_path):
    path = tmp_path / "lock"
    spawn = multiprocessing.get_context("spawn")
    ready = spawn.Event()
    done = spawn.Event()
    holder = spawn.Process(target=hold, args=(path, ready, done))
    holder.start()
    assert ready.wait(60)
    assert not FileLock(path).try_acquire()
    done.set()  # it ends without releasing
    holder.join()
    with locked(path):
        assert path.exists()
    assert not path.exists()


@pytest.fixture(params=["flock", "msvcrt"])
def way(request, monkeypatch) -> str:
    """Locks as on Linux, and as on Windows, whose function is made of flock here."""
    if request.param == "msvcrt":
        fcntl = pytest.importorskip("fcntl")

        def locking(handle: int, mode: int, count: int) -> None:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise PermissionError(13, "Permission denied") from error

        monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=2))
        monkeypatch.setattr(locks, "fcntl", None)
    return request.param


def test_the_next_one_gets_the_lock(tmp_path, way):
    path = tmp_path / "lock"
    first = FileLock(path)
    second = FileLock(path)
    assert first.try_acquire()
    assert not second.try_acquire()
    first.release()
    first.release()  # it is released already
    assert second.try_acquire()
    second.release()
    assert not path.exists()


def test_a_lock_is_never_held_twice(tmp_path, way):
    """Each release removes the file, which another thread may have opened by then."""
    path = tmp_path / "lock"
    inside = []
    most = []

    def work() -> None:
        for _ in range(100):
            lock = FileLock(path)
            if lock.try_acquire():
                inside.append(1)
                most.append(len(inside))
                inside.pop()
                lock.release()

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most and max(most) == 1


def test_a_link_is_not_followed(tmp_path):
    target = tmp_path / "precious"
    target.write_text("mine")
    (tmp_path / "lock").symlink_to(target)
    with pytest.raises(OSError, match="symbolic links"):
        FileLock(tmp_path / "lock").try_acquire()
    assert target.read_text() == "mine"
