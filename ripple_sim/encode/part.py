"""The folder of an unfinished video: complete segments, with which a killed render continues.

`clip.mp4.part` stands beside `clip.mp4` until that is complete. It holds `frames/`, the segments (a
clip of some frames that plays, or an image per frame), `settings.json`, what the video is rendered
with, and `states.txt`, fingerprints of the simulation against which a resumed render is checked.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

from ripple_sim.errors import VideoError

from .output import check_replaceable
from .replace import MARK, is_plain, made_here, move, read_object

SETTINGS = "settings.json"
STATES = "states.txt"
_FRAMES = "frames"
_WHOLE = "whole"
# the semicolon is missing where a killed process cut the line off
_STATE = re.compile(r"([0-9]{1,9}) ([0-9a-f]+);")
_SEGMENT = re.compile(r"frames?_(\d+)(?:-(\d+))?")
# what decides the content of a file, by the names in messages
Settings = Mapping[str, str | int | float]


class Part:
    """The folder of one unfinished video, locked against other processes.

    Parameters
    ----------
    video : path
        Where the video will stand.
    suffix : str
        Ending of its segments.
    length : int
        Frames in a segment.
    settings : mapping
        Everything that decides the pixels, by name.
    resume : bool
        Continue an unfinished video if there is one. Otherwise remove it.
    overwrite : bool
        Replace an older video that was not written here.

    Raises
    ------
    VideoError
        If another process is writing this video, the folder holds anything else, or the settings
        there are others.
    OSError
        If the folder cannot be written.

    Attributes
    ----------
    unfinished, whole : Path
        Where the next segment, and the video's file, are written until they are complete.
    segments : list of (path, int)
        Complete ones in their order, and the number of each one's first frame.
    frames : int
        How many are stored.
    """

    def __init__(
        self,
        video: Path,
        suffix: str,
        length: int,
        settings: Settings,
        *,
        resume: bool,
        overwrite: bool,
    ) -> None:
        self.video = video
        self._overwrite = overwrite
        self.folder = video.with_name(video.name + ".part")
        self._suffix = suffix
        self._length = length
        self._segments = self.folder / _FRAMES
        self.unfinished = self._segments / f".unfinished{suffix}"
        self.whole = self.folder / _WHOLE
        if self.folder.is_symlink():
            raise VideoError(
                f"cannot write {video}: its folder {self.folder.name} is a link; move it away"
            )
        if self.folder.exists() and not self.folder.is_dir():
            raise VideoError(
                f"cannot write {video}: {self.folder.name} beside it is no folder; move it away"
            )
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock = os.open(self.folder, os.O_RDONLY | os.O_NOFOLLOW)
        try:
            self._claim()
            # a kill while all is removed may have left the settings alone
            if resume and (self.folder / SETTINGS).exists() and self._segments.is_dir():
                self._compare({MARK: True, **settings})
                self._drop_unfinished()
            else:
                # first: without it nothing is continued
                (self.folder / SETTINGS).unlink(missing_ok=True)
                for entry in self.folder.iterdir():
                    shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
                self._segments.mkdir()
                unfinished = self.folder / f".{SETTINGS}"
                unfinished.write_text(json.dumps({MARK: True, **settings}, indent=1))
                # last: while it is missing there is nothing to continue
                move(unfinished, self.folder / SETTINGS)
            states = self.folder / STATES
            lines = states.read_text(errors="replace").splitlines() if states.exists() else []
            # fingerprints of the simulation that were recorded, by frame
            self._states = {
                int(line[1]): line[2] for line in map(_STATE.fullmatch, lines) if line is not None
            }
        except BaseException:
            os.close(self._lock)
            raise
        self.segments: list[tuple[Path, int]] = []
        self.frames = 0
        for path in sorted(self._segments.iterdir(), key=lambda path: (len(path.name), path.name)):
            numbers = _SEGMENT.fullmatch(path.stem)
            # what comes after a gap is made again
            if numbers is not None and int(numbers[1]) == self.frames:
                self.segments.append((path, self.frames))
                self.frames = int(numbers[2] or numbers[1]) + 1

    def store(self, frames: int) -> None:
        """Add the unfinished segment, of that many frames, to the complete ones."""
        first = self.frames
        name = (
            f"frame_{first:05d}"
            if self._length == 1
            else f"frames_{first:05d}-{first + frames - 1:05d}"
        )
        path = self._segments / (name + self._suffix)
        move(self.unfinished, path)
        self.segments.append((path, first))
        self.frames += frames

    def check_state(self, frame: int, digest: str) -> None:
        """Record the simulation's fingerprint at a frame, or compare it with the one that is known.

        Raises `VideoError` if it differs.
        """
        if frame not in self._states:
            self._states[frame] = digest
            with (self.folder / STATES).open("a") as file:
                # on a line of its own even if the last one was cut off
                file.write(f"\n{frame} {digest};\n")
        elif self._states[frame] != digest:
            raise VideoError(
                f"cannot resume {self.video}: at frame {frame} the simulation is not in the state "
                "it was in before; a hook, a library or the processor has changed: leave "
                "--resume out to start again"
            )

    def finish(self) -> None:
        """Move the finished file or folder to the video's place, and remove everything else.

        Raises `VideoError` if there is something in that place by now that was not made here.
        """
        if self.video.exists():
            check_replaceable(self.video, self._overwrite)  # again: a render takes long
            if self.video.is_dir():
                shutil.rmtree(self.video)
        move(self.whole if self.whole.exists() else self._segments, self.video)
        self.remove()

    def hand_over(self, folder: Path) -> None:
        """Move the segments to a folder that is not there yet, and remove everything else."""
        move(self._segments, folder)
        self.remove()

    def keep(self) -> str:
        """Keep the complete segments for a later run, and return a message that says so.

        Without any segment, remove everything and return an empty message.
        """
        if not self.frames:
            self.remove()
            return ""
        self._drop_unfinished()
        os.close(self._lock)
        return f"{self.frames} frames are kept in {self.folder}; --resume carries on from there"

    def remove(self) -> None:
        """Remove everything."""
        shutil.rmtree(self.folder, ignore_errors=True)
        os.close(self._lock)

    def _compare(self, settings: Settings) -> None:
        """Raise `VideoError` with the first setting that differs from the interrupted video."""
        old = json.loads((self.folder / SETTINGS).read_text())
        new = json.loads(json.dumps(settings))
        for name in sorted({*old, *new}):
            before = old.get(name)
            now = new.get(name)
            if before != now:
                raise VideoError(
                    f"cannot resume {self.video}: {name} was {before} and now is {now}; restore "
                    "it, or leave --resume out to start again"
                )

    def _claim(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise VideoError(
                f"another process is writing {self.video}; wait until it is done, or name another "
                "file"
            ) from error
        if strangers := sorted(self._strangers()):
            raise VideoError(
                f"cannot write {self.video}: its folder {self.folder.name} holds other files "
                f"({strangers[0]}); move it away, or name another file"
            )

    def _strangers(self) -> Iterator[str]:
        """Names of foreign files, in the folder and in the folder of the segments."""
        ours = MARK in read_object(self.folder / SETTINGS)
        for entry in self.folder.iterdir():
            own = is_plain(entry) and entry.name.lstrip(".") in (SETTINGS, STATES, _WHOLE)
            if entry.name == _FRAMES and entry.is_dir() and not entry.is_symlink():
                for each in entry.iterdir():
                    segment = _SEGMENT.fullmatch(each.stem) is not None and (
                        ours or made_here(each)
                    )
                    if not (is_plain(each) and (segment or each.name.startswith(".unfinished."))):
                        yield f"{_FRAMES}/{each.name}"
            elif not own or (entry.name == SETTINGS and not ours):
                yield entry.name

    def _drop_unfinished(self) -> None:
        self.unfinished.unlink(missing_ok=True)
        self.whole.unlink(missing_ok=True)
