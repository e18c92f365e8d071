"""Files that appear complete or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

try:
    import resource
except ImportError:  # on Windows
    resource = None  # type: ignore[assignment]


# Errors of the system that another name would have avoided.
OF_THE_NAME = (
    errno.ENAMETOOLONG,
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.EINVAL,
    errno.ELOOP,
)


# Those of them that hold in every folder.
NO_NAME = (errno.ENAMETOOLONG, errno.ELOOP)


# Errors of the disk, which no other input would have avoided.
OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


# What is written beside a file before it takes its name has a longer one.
_LONGEST_SUFFIX = ".0123456789.part"


def final_path(path: Path) -> Path:
    """Where a path to be written leads, its symbolic links followed.

    Raises `OSError` if links lead in a circle, or the name is too long for the system, or too long
    to be written beside first.
    """
    final = Path(os.path.realpath(path))
    if final.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
    try:
        final.with_name(final.name + _LONGEST_SUFFIX).lstat()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise OSError(error.errno, error.strerror, str(path)) from error
    return final


@contextlib.contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, renamed to `path` at the end, removed after an exception.

    Symbolic links are followed, missing folders made. Raises `OSError` if the path exists and is
    not a regular file (renaming would destroy a device, say), or cannot be written.
    """
    path = final_path(path)
    if path.exists() and not path.is_file():
        raise FileExistsError(0, "it exists and is not a regular file")
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
