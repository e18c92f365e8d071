"""Which files may be replaced: every file written here carries a mark."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PIL.PngImagePlugin import PngInfo

MARK = "made by ripple-sim"

# Windows flushes only files that are open for writing.
_IS_WINDOWS = os.name == "nt"

# The mark is in the first or in the last so many bytes of a file.
_HEAD_SIZE = 1 << 16
_TAIL_SIZE = 1 << 10

# An MP4 has the mark behind its index, which grows with the video: so many bytes of it are read.
_MP4_HEAD_SIZE = 1 << 24


def made_here(path: Path) -> bool:
    """Whether a path is a regular file that was written here, or an empty one."""
    status = path.lstat()
    if not stat.S_ISREG(status.st_mode):
        return False
    if status.st_size == 0:
        return True
    with path.open("rb") as file:
        head = file.read(_MP4_HEAD_SIZE if path.suffix.lower() == ".mp4" else _HEAD_SIZE)
        file.seek(max(0, status.st_size - _TAIL_SIZE), os.SEEK_SET)
        return MARK.encode() in head + file.read()


def is_plain(path: Path) -> bool:
    """Whether a path is a file and no link."""
    return path.is_file() and not path.is_symlink()


def read_object(path: Path) -> dict[str, Any]:
    """The object in a JSON file; empty if the file is missing, damaged, special or no object."""
    try:
        content = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
    # RecursionError: brackets in brackets without end
    except (OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def png_mark() -> PngInfo:
    """The mark as text of a PNG."""
    info = PngInfo()
    info.add_text("Software", MARK)
    return info


def mark_gif(path: Path) -> None:
    """Put the mark into a finished GIF, as a comment before its last byte."""
    text = MARK.encode()
    with path.open("r+b") as file:
        file.seek(-1, os.SEEK_END)
        file.write(b"\x21\xfe" + bytes([len(text)]) + text + b"\x00\x3b")


def check_folder(
    error: type[Exception], content: str, folder: Path, is_ours: Callable[[Path], object]
) -> None:
    """Check that a folder holds only files that were made here, and so may be replaced.

    Parameters
    ----------
    error : type
        Of the exception that is raised if the folder holds anything else.
    content : str
        What will be written to the folder, for the message.
    folder : Path
        It may be missing.
    is_ours : callable
        Whether a plain file was made here.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise error(f"cannot write {content} to {folder}: it is not a folder; name another output")
    for entry in folder.iterdir() if folder.is_dir() else ():
        if not (is_plain(entry) and is_ours(entry)):
            raise error(
                f"cannot write {content} to {folder}: it holds other files ({entry.name}); name "
                "another output"
            )


def sync(path: Path) -> None:
    """Wait until a file or folder has reached the disk."""
    if _IS_WINDOWS and path.is_dir():  # no folder can be opened there
        return
    handle = os.open(path, os.O_RDWR if _IS_WINDOWS else os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def move(source: Path, target: Path) -> None:
    """Rename a finished file or folder once it has reached the disk."""
    sync(source)
    source.replace(target)
