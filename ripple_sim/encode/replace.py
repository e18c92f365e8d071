"""What may be replaced, and what may be continued.

Every file that is written here has a mark, by which a later job knows what it may replace without being told to. A
`Record` has what an interrupted video is known by: the settings it was rendered with, and fingerprints of its
simulation.
"""

from __future__ import annotations

import json
import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path

from PIL.PngImagePlugin import PngInfo

from ripple_sim.errors import VideoError

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


SETTINGS, STATES = "settings.json", "states.txt"
_STATE = re.compile(r"(\d+) ([0-9a-f]+);")  # the semicolon is missing where a killed process cut the line off


class Record:
    """The settings and fingerprints in the folder of one video.

    Parameters
    ----------
    video : path
        For messages.
    folder : path
        Of the unfinished video.
    """

    def __init__(self, video: Path, folder: Path) -> None:
        self._video, self._settings, self._states = video, folder / SETTINGS, folder / STATES
        self._unfinished = folder / f".{SETTINGS}"

    @property
    def exists(self) -> bool:
        """Whether there is a video to continue."""
        return self._settings.exists()

    @property
    def made_here(self) -> bool:
        """Whether the settings were written by a record."""
        try:
            return MARK in json.loads(self._settings.read_text())
        except (OSError, ValueError, TypeError):
            return False

    def start(self, settings: Mapping[str, object]) -> None:
        """Write the settings. Call it last: while they are missing there is nothing to continue."""
        self._unfinished.write_text(json.dumps({MARK: True, **settings}, indent=1))
        move(self._unfinished, self._settings)

    def forget(self) -> None:
        """Remove the settings. Call it first: without them nothing is continued."""
        self._settings.unlink(missing_ok=True)

    def compare(self, settings: Mapping[str, object]) -> None:
        """Make sure that the settings are those of the interrupted video.

        Raises
        ------
        VideoError
            Naming the first that differs.
        """
        old, new = json.loads(self._settings.read_text()), json.loads(json.dumps({MARK: True, **settings}))
        for name in sorted({*old, *new}):
            before, now = old.get(name), new.get(name)
            if before != now:
                raise VideoError(
                    f"cannot resume {self._video}: {name} was {before} and now is {now}; restore it, or leave --resume "
                    "out to start again"
                )

    def states(self) -> dict[int, str]:
        """Fingerprints that were recorded, by frame."""
        lines = self._states.read_text().splitlines() if self._states.exists() else []
        return {int(line[1]): line[2] for line in map(_STATE.fullmatch, lines) if line is not None}

    def check_state(self, known: dict[int, str], frame: int, digest: str) -> None:
        """Record a frame's fingerprint, in the file and in `known`, or compare it with the one that is known.

        Raises
        ------
        VideoError
            If it differs.
        """
        if frame not in known:
            known[frame] = digest
            with self._states.open("a") as file:
                file.write(f"\n{frame} {digest};\n")  # on a line of its own even if the last one was cut off
        elif known[frame] != digest:
            raise VideoError(
                f"cannot resume {self._video}: at frame {frame} the simulation is not in the state it was in before; a "
                "hook, a library or the processor has changed: leave --resume out to start again"
            )
