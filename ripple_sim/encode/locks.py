"""A lock between processes: a file that one process holds at a time.

The system releases a lock when its process ends, however it ends. It is `flock` on Linux and macOS,
and `msvcrt.locking` on Windows, whose files cannot be removed while a process has them open.
"""

from __future__ import annotations

import contextlib
import errno
import os
import time
from collections.abc import Iterator
from pathlib import Path

try:
    import fcntl
except ImportError:  # on Windows
    fcntl = None  # type: ignore[assignment]

# [s]: time between two tries of a process that waits
_RETRY = 0.05

# What msvcrt.locking reports for a file that another process holds.
_HELD = (errno.EACCES, errno.EDEADLK)

# A link is not followed, where the system can tell.
_OPEN_FLAGS = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)


class FileLock:
    """A lock by the name of a file, which is there as long as the lock is held.

    Parameters
    ----------
    path : Path
        A new file, or one that a killed process has left.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._handle: int | None = None

    def try_acquire(self) -> bool:
        """Take the lock; False if another process holds it."""
        while True:
            handle = os.open(self._path, _OPEN_FLAGS, 0o666)
            try:
                if not _lock(handle):
                    os.close(handle)
                    return False
                if _is_at(handle, self._path):
                    self._handle = handle
                    return True
            except BaseException:
                os.close(handle)
                raise
            os.close(handle)  # the process before has removed this file

    def acquire(self) -> None:
        """Take the lock; wait while another process holds it."""
        while not self.try_acquire():
            time.sleep(_RETRY)

    def release(self) -> None:
        """Remove the file and release the lock, if it is held."""
        if self._handle is None:
            return
        handle = self._handle
        self._handle = None
        is_removed = _remove(self._path)
        os.close(handle)
        if not is_removed:  # on Windows
            _remove(self._path)


@contextlib.contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold the lock by the name of a file within the block; wait for it first."""
    lock = FileLock(path)
    lock.acquire()
    try:
        yield
    finally:
        lock.release()


def _lock(handle: int) -> bool:
    """Lock an open file without waiting; False if another process holds it."""
    if fcntl is not None:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True
    import msvcrt

    try:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    except OSError as error:
        if error.errno in _HELD:
            return False
        raise
    return True


def _is_at(handle: int, path: Path) -> bool:
    """Whether an open file is the one that has the name now."""
    try:
        return os.path.samestat(os.fstat(handle), path.lstat())
    except FileNotFoundError:
        return False


def _remove(path: Path) -> bool:
    """Remove a file; False where the system refuses while it is open."""
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return False
    return True
