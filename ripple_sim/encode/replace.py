"""What may be replaced: files that are written here have a mark, by which a later job knows them without being told."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from PIL.PngImagePlugin import PngInfo

MARK = "made by ripple-sim"

# Where the mark is in a file [bytes]. An MP4 has it behind its index, which grows with the length of the video.
_HEAD, _INDEX, _TAIL = 1 << 16, 1 << 24, 1 << 10


def made_here(path: Path) -> bool:
    """Whether a path is a regular file that was written here, or an empty one, with which nothing is lost."""
    found = path.lstat()
    if not stat.S_ISREG(found.st_mode):
        return False
    if found.st_size == 0:
        return True
    with path.open("rb") as file:
        head = file.read(_INDEX if path.suffix.lower() == ".mp4" else _HEAD)
        file.seek(max(0, found.st_size - _TAIL), os.SEEK_SET)
        return MARK.encode() in head + file.read()


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


def move(source: Path, target: Path) -> None:
    """Rename a finished file or folder once it has reached the disk."""
    handle = os.open(source, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
    source.replace(target)
