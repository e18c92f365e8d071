"""Files that appear complete or not at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to, renamed to `path` at the end, removed after an exception.

    Symbolic links are followed, missing folders made.

    Raises
    ------
    OSError
        If the path exists and is not a regular file (renaming would destroy a device, say), or cannot be written.
    """
    path = path.resolve()
    if path.exists() and not path.is_file():
        raise FileExistsError(0, "it exists and is not a regular file")
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield unfinished
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
