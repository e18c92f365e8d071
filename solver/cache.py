"""Caches of results that take long to compute: in the user's cache folder, and in memory.

The name of a file in the folder is a hash of the input of the result. The folder has a size limit:
the least recently used file is deleted first. Several processes may use the folder at once: a file
appears whole, and a process that misses a file computes the result again. In memory, results are
kept for the next caller with the same input: the next scene of a batch, or the next target.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import os
import re
import shutil
import stat
import tempfile
from collections import OrderedDict
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Generic, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
import platformdirs
from numpy.typing import NDArray

from .errors import RippleError, warn_caller

LIMIT = "RIPPLE_SIM_CACHE_LIMIT"  # the environment variable of the size limit [MB]
_DEFAULT_LIMIT = 500  # [MB]
_MEGABYTE = 1_000_000  # [bytes]

_KEY_DIGITS = 32  # hexadecimal digits of a `content_key`

# Names of this package's files: files of `cache_path`, and unfinished files of killed processes.
_CACHE_FILE = re.compile(r"[0-9a-f]{32}\.npz|\.[0-9a-f]{32}\.npz\.[0-9]+\.part")


def cache_folder() -> Path:
    """The cache folder; private and temporary where the home folder cannot be written."""
    try:
        folder = Path(platformdirs.user_cache_dir("ripple-sim"))
        if not folder.is_absolute():  # "~/.cache": no HOME, and no such user
            raise RuntimeError("there is no home directory")
        folder.mkdir(parents=True, exist_ok=True)
    except (RuntimeError, OSError) as error:
        return _private_folder(str(error))
    return folder


@functools.cache
def _private_folder(reason: str) -> Path:
    """A temporary folder that only this user can read; its first use gives a warning."""
    folder = _lasting_private_folder()
    if folder is None:
        folder = Path(tempfile.mkdtemp(prefix="ripple-sim-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    warn_caller(
        f"{reason}: kernels and atlases are kept in {folder}; set XDG_CACHE_HOME to a folder that "
        f"lasts"
    )
    return folder


def _lasting_private_folder() -> Path | None:
    """A folder of this user that outlives the process; None where it may be another user's."""
    if not hasattr(os, "getuid"):  # Windows, whose temporary folder is the user's own
        folder = Path(tempfile.gettempdir()) / "ripple-sim"
        with contextlib.suppress(OSError):
            folder.mkdir(exist_ok=True)
            return folder
        return None
    folder = Path(tempfile.gettempdir()) / f"ripple-sim-{os.getuid()}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        is_own = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()
        if is_own and not status.st_mode & 0o077:
            return folder
    return None


def cache_path(name: str, arrays: Iterable[NDArray]) -> Path:
    """Path in the cache of the result of a method `name` from arrays.

    Raises `RippleError` as `cache_limit` does.
    """
    cache_limit()  # a wrong limit is reported before any work that takes time
    return cache_folder() / f"{content_key(name, arrays)}.npz"


def content_key(name: str, arrays: Iterable[NDArray]) -> str:
    """Hash of a name and the content of arrays, 32 hexadecimal digits."""
    contents = [np.ascontiguousarray(array) for array in arrays]
    key = hashlib.sha256(" ".join([name, *(str(array.shape) for array in contents)]).encode())
    for array in contents:
        key.update(array.data)
    return key.hexdigest()[:_KEY_DIGITS]


def cache_limit() -> int:
    """The size limit of the cache [bytes]: RIPPLE_SIM_CACHE_LIMIT megabytes, or 500.

    Raises `RippleError` if the variable is not a number, or negative.
    """
    text = os.environ.get(LIMIT, "").strip()
    try:
        limit = float(text) if text else _DEFAULT_LIMIT
        if not 0 <= limit < np.inf:
            raise ValueError
    except ValueError:
        raise RippleError(
            f"{LIMIT} must be a number of megabytes, 0 or more, got {text!r}"
        ) from None
    return int(limit * _MEGABYTE)


def cached_files() -> dict[Path, int]:
    """Sizes [bytes] of this package's files in the cache, the least recently used file first."""
    files = []
    with contextlib.suppress(OSError):  # no folder, or one that cannot be read
        for path in cache_folder().iterdir():
            with contextlib.suppress(OSError):  # another process has removed it
                if _CACHE_FILE.fullmatch(path.name) and path.is_file():
                    status = path.stat()
                    files.append((status.st_mtime, path.name, path, status.st_size))
    return {path: size for _, _, path, size in sorted(files)}


def mark_used(path: Path) -> None:
    """Note that a file of the cache was used just now."""
    with contextlib.suppress(OSError):
        os.utime(path)


def make_room(newest: Path) -> None:
    """Remove the least recently used files until the cache is under its limit.

    The newest file stays, unless the limit is 0.
    """
    files = cached_files()
    limit = cache_limit()
    total = sum(files.values())
    for path, size in files.items():
        if total <= limit:
            break
        if limit == 0 or path.name != newest.name:
            total -= size * removed(path)


def removed(path: Path) -> bool:
    """Remove a file from the cache; return whether it is gone."""
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)
        return True
    return False


Owner = TypeVar("Owner")
Result = TypeVar("Result")


class ResultCache(Generic[Result]):
    """The latest `count` results by their keys, as far as they are `small` enough to be kept.

    All callers share the results, and must not change them.
    """

    def __init__(self, count: int, small: Callable[[Result], bool]) -> None:
        self._count = count
        self._small = small
        self._results: OrderedDict[str, Result] = OrderedDict()
        # Python may end without freeing modules; nanobind then reports results as leaks on stderr
        atexit.register(self._results.clear)

    def get(self, key: str, make: Callable[[], Result]) -> Result:
        """The result of a key; `make` computes it if it is not in the cache."""
        result = self._results.pop(key, None)
        if result is None:
            result = make()
        if self._small(result):
            self._results[key] = result
        while len(self._results) > self._count:
            self._results.popitem(last=False)
        return result


def kept_with(make: Callable[[Owner], Result]) -> Callable[[Owner], Result]:
    """Decorate a function of one object: its result is kept as long as the object lives.

    Objects are compared by identity.
    """
    results: WeakKeyDictionary[Owner, Result] = WeakKeyDictionary()

    @functools.wraps(make)
    def kept(owner: Owner) -> Result:
        result = results.get(owner)
        if result is None:
            result = results[owner] = make(owner)
        return result

    return kept
