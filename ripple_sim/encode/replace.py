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

# [bytes]: the mark is in this much of a file's beginning, or in this much of its end
_HEAD_SIZE = 1 << 16
_TAIL_SIZE = 1 << 10

# [bytes]: likewise of an MP4, which has it behind its index; the index grows with the video
_MP4_HEAD_SIZE = 1 << 24


def made_here(path: Path) -> bool:
    """Whether a path is a regular file that was written here, or an empty one."""
    found = path.lstat()
    if not stat.S_ISREG(found.st_mode):
        return False
    if found.st_size == 0:
        return True
    with path.open("rb") as file:
        head = file.read(_MP4_HEAD_SIZE if path.suffix.lower() == ".mp4" else _HEAD_SIZE)
        file.seek(max(0, found.st_size - _TAIL_SIZE), os.SEEK_SET)
        return MARK.encode() in head + file.read()


def is_plain(path: Path) -> bool:
    """Whether a path is a file and no link."""
    return path.is_file() and not path.is_symlink()


def read_object(path: Path) -> dict[str, Any]:
    """The object in a JSON file; empty if the file is missing, damaged, special or no object."""
    try:
        found = json.loads(path.read_text()) if path.is_file() else None
    except (
        OSError,
        ValueError,
        RecursionError,
    ):  # RecursionError: brackets in brackets without end
        return {}
    return found if isinstance(found, dict) else {}


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
    kind: type[Exception], what: str, folder: Path, own: Callable[[Path], object]
) -> None:
    """Check that a folder, to which `what` will be written, holds only files made here.

    Raises an error of type `kind` otherwise.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise kind(f"cannot write {what} to {folder}: it is not a folder; name another output")
    for each in folder.iterdir() if folder.is_dir() else ():
        if not (is_plain(each) and own(each)):
            raise kind(
                f"cannot write {what} to {folder}: it holds other files ({each.name}); name "
                "another output"
            )


def sync(path: Path) -> None:
    """Wait until a file or folder has reached the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def move(source: Path, target: Path) -> None:
    """Rename a finished file or folder once it has reached the disk."""
    sync(source)
    source.replace(target)
