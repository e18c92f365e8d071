"""The folder of an unfinished video: complete segments, with which a killed render continues.

`clip.mp4.part` stands beside `clip.mp4` until that is complete. It holds `frames/`, the segments (a
clip of some frames that plays, or an image per frame), `settings.json`, what the video is rendered
with, and `states.txt`, fingerprints of the simulation against which a resumed render is checked.
"""

from __future__ import annotations

import contextlib
import json
import re
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path

from ripple_sim.errors import VideoError

from .locks import FileLock
from .output import check_replaceable
from .replace import MARK, is_plain, made_here, move, read_object

SETTINGS = "settings.json"
STATES = "states.txt"
_FRAMES = "frames"
_WHOLE = "whole"
_LOCK = ".lock"
# A line of the states: a frame and its fingerprint. The semicolon is missing where a killed process
# cut the line off.
_STATE = re.compile(r"([0-9]{1,9}) ([0-9a-f]+);")
# Name of a segment: its first frame, and its last one.
_SEGMENT = re.compile(r"frames?_(\d+)(?:-(\d+))?")
# What decides the content of a video, by the names in messages.
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
        self._lock = FileLock(self.folder / _LOCK)
        try:
            self._claim()
            # a kill while all is removed may have left the settings alone
            if resume and (self.folder / SETTINGS).exists() and self._segments.is_dir():
                self._compare({MARK: True, **settings})
                self._drop_unfinished()
            else:
                self._begin_anew({MARK: True, **settings})
            self._states = self._recorded_states()
        except BaseException:
            self._lock.release()
            raise
        self.segments: list[tuple[Path, int]] = []
        self.frames = 0
        self._find_segments()

    def _begin_anew(self, settings: Settings) -> None:
        """Empty the folder, and write the settings into it."""
        # first: without the settings nothing is continued
        (self.folder / SETTINGS).unlink(missing_ok=True)
        for entry in self._entries():
            shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
        self._segments.mkdir()
        unfinished = self.folder / f".{SETTINGS}"
        unfinished.write_text(json.dumps(settings, indent=1))
        # last: while the settings are missing there is nothing to continue
        move(unfinished, self.folder / SETTINGS)

    def _recorded_states(self) -> dict[int, str]:
        """Fingerprints of the simulation that were recorded, by frame."""
        states = self.folder / STATES
        if not states.exists():
            return {}
        lines = states.read_text(errors="replace").splitlines()
        matches = [_STATE.fullmatch(line) for line in lines]
        return {int(match[1]): match[2] for match in matches if match is not None}

    def _find_segments(self) -> None:
        """Take up the segments that earlier writers have stored."""
        for path in sorted(self._segments.iterdir(), key=lambda path: (len(path.name), path.name)):
            numbers = _SEGMENT.fullmatch(path.stem)
            # the segments after a gap are made again
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
        self._lock.release()
        return f"{self.frames} frames are kept in {self.folder}; --resume carries on from there"

    def remove(self) -> None:
        """Remove everything."""
        for entry in self._entries():
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                with contextlib.suppress(OSError):
                    entry.unlink()
        self._lock.release()
        with contextlib.suppress(OSError):  # something is left in it
            self.folder.rmdir()

    def _entries(self) -> list[Path]:
        """What is in the folder, without the lock."""
        return [entry for entry in self.folder.iterdir() if entry.name != _LOCK]

    def _compare(self, settings: Settings) -> None:
        """Raise `VideoError` with the first setting that differs from the interrupted video."""
        old = json.loads((self.folder / SETTINGS).read_text())
        new = json.loads(json.dumps(settings))
        for name in sorted({*old, *new}):
            if old.get(name) != new.get(name):
                raise VideoError(
                    f"cannot resume {self.video}: {name} was {old.get(name)} and now is "
                    f"{new.get(name)}; restore it, or leave --resume out to start again"
                )

    def _claim(self) -> None:
        """Lock the folder, and make sure that it holds no other files."""
        if not self._lock.try_acquire():
            raise VideoError(
                f"another process is writing {self.video}; wait until it is done, or name another "
                "file"
            )
        other_files = sorted(self._other_files())
        if other_files:
            raise VideoError(
                f"cannot write {self.video}: its folder {self.folder.name} holds other files "
                f"({other_files[0]}); move it away, or name another file"
            )

    def _other_files(self) -> Iterator[str]:
        """Names of files that were not made here, in the folder and in that of the segments."""
        has_our_settings = MARK in read_object(self.folder / SETTINGS)
        for entry in self._entries():
            if entry.name == _FRAMES and entry.is_dir() and not entry.is_symlink():
                for file in entry.iterdir():
                    if not _is_segment(file, has_our_settings):
                        yield f"{_FRAMES}/{file.name}"
                continue
            is_ours = is_plain(entry) and entry.name.lstrip(".") in (SETTINGS, STATES, _WHOLE)
            if not is_ours or (entry.name == SETTINGS and not has_our_settings):
                yield entry.name

    def _drop_unfinished(self) -> None:
        self.unfinished.unlink(missing_ok=True)
        self.whole.unlink(missing_ok=True)


def _is_segment(file: Path, has_our_settings: bool) -> bool:
    """Whether a file in the folder of the segments is a segment, complete or unfinished.

    Segments beside settings of ours are ours; otherwise they must carry the mark.
    """
    if not is_plain(file):
        return False
    if file.name.startswith(".unfinished."):
        return True
    return _SEGMENT.fullmatch(file.stem) is not None and (has_our_settings or made_here(file))
