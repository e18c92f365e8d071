"""What took long to make, kept: in the user's cache folder, and in memory.

A file in the folder lies under a hash of what it was made from. The folder is kept under a limit:
what was used longest ago goes first. Several processes may use it at once: a file appears whole,
and whoever misses one makes it again. In memory, results are for the next one who asks for the
same: the next scene of a batch, or the next target.
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

LIMIT = "RIPPLE_SIM_CACHE_LIMIT"  # the environment variable, in megabytes
_USUAL_LIMIT = 500
_MEGABYTE = 1_000_000

# what is ours: files of `cache_path`, and those that a killed process left unfinished
_OURS = re.compile(r"[0-9a-f]{32}\.npz|\.[0-9a-f]{32}\.npz\.[0-9]+\.part")


def cache_folder() -> Path:
    """Where the cache is. Without a home that can be written it is private and temporary."""
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
    """A folder for temporary files that only this user can read, and a warning, once a process."""
    folder = Path(tempfile.gettempdir()) / f"ripple-sim-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
        safe = (
            stat.S_ISDIR(status.st_mode)
            and status.st_uid == os.getuid()
            and not status.st_mode & 0o077
        )
    except OSError:
        safe = False
    if not safe:  # somebody else's
        folder = Path(tempfile.mkdtemp(prefix="ripple-sim-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    warn_caller(
        f"{reason}: kernels and atlases are kept in {folder}; set XDG_CACHE_HOME to a folder that "
        f"lasts"
    )
    return folder


def cache_path(name: str, arrays: Iterable[NDArray]) -> Path:
    """Place in the cache of what is made from arrays by the method `name`; raises `RippleError` as `cache_limit`."""
    cache_limit()  # a mistake is told before anything that takes time
    return cache_folder() / f"{content_key(name, arrays)}.npz"


def content_key(name: str, arrays: Iterable[NDArray]) -> str:
    """Hash of a name and the content of arrays, 32 hexadecimal digits."""
    contents = [np.ascontiguousarray(array) for array in arrays]
    key = hashlib.sha256(" ".join([name, *(str(array.shape) for array in contents)]).encode())
    for array in contents:
        key.update(array.data)
    return key.hexdigest()[:32]


def cache_limit() -> int:
    """How large the cache may grow [bytes]: RIPPLE_SIM_CACHE_LIMIT megabytes, or 500.

    Raises `RippleError` if the variable is not a number, or negative.
    """
    given = os.environ.get(LIMIT, "").strip()
    try:
        limit = float(given) if given else _USUAL_LIMIT
        if not 0 <= limit < np.inf:
            raise ValueError
    except ValueError:
        raise RippleError(
            f"{LIMIT} is {given!r}; valid is a number of megabytes, 0 or more"
        ) from None
    return int(limit * _MEGABYTE)


def cached_files() -> dict[Path, int]:
    """Sizes [bytes] of the files in the cache that are ours, the one used longest ago first."""
    files = {}
    with contextlib.suppress(OSError):  # no folder, or one that cannot be read
        for path in cache_folder().iterdir():
            with contextlib.suppress(OSError):  # another process has removed it
                if _OURS.fullmatch(path.name) and path.is_file():
                    status = path.stat()
                    files[path] = status.st_mtime, status.st_size
    return {
        path: size
        for path, (_, size) in sorted(files.items(), key=lambda file: (file[1][0], file[0].name))
    }


def mark_used(path: Path) -> None:
    """Note that a file of the cache was used just now."""
    with contextlib.suppress(OSError):
        os.utime(path)


def make_room(newest: Path) -> None:
    """Remove what was used longest ago until the cache is under its limit; the newest file stays, unless that is 0."""
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

    They are shared by all who ask, and not to be changed.
    """

    def __init__(self, count: int, small: Callable[[Result], bool]) -> None:
        self._count = count
        self._small = small
        self._results: OrderedDict[str, Result] = OrderedDict()

    def get(self, key: str, make: Callable[[], Result]) -> Result:
        """The result of a key, made if it is not there."""
        result = self._results.pop(key, None)
        if result is None:
            result = make()
        if self._small(result):
            self._results[key] = result
        while len(self._results) > self._count:
            self._results.popitem(last=False)
        return result


def kept_with(make: Callable[[Owner], Result]) -> Callable[[Owner], Result]:
    """Decorate what is made from one object, compared by identity: made once, and kept as long as the object lives."""
    results: WeakKeyDictionary[Owner, Result] = WeakKeyDictionary()

    @functools.wraps(make)
    def kept(owner: Owner) -> Result:
        result = results.get(owner)
        if result is None:
            result = results[owner] = make(owner)
        return result

    return kept
