"""Files that appear complete or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

# Errors of the system that come from the name of a file: another name would avoid them.
OF_THE_NAME = (
    errno.ENAMETOOLONG,
    errno.ENOENT,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.EINVAL,
    errno.ELOOP,
)

# Errors of a name that hold in every folder.
NO_NAME = (errno.ENAMETOOLONG, errno.ELOOP)

# Errors of the disk: no other input would avoid them.
OF_THE_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)

# The longest suffix of an unfinished file, which is written beside the final file.
_LONGEST_SUFFIX = ".0123456789.part"


def final_path(path: Path) -> Path:
    """The path that will be written, after its symbolic links.

    Raises `OSError` if links lead in a circle, or if the name is too long for the system, also with
    the suffix of an unfinished file.
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
    """Give a temporary path beside `path` to write to.

    The file is renamed to `path` at the end, or removed after an exception. Symbolic links are
    followed, and missing folders are made. Raises `OSError` if the path exists and is not a regular
    file (renaming would destroy a device, for instance), or if it cannot be written.
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
