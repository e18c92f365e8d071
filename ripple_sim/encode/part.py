"""The folder in which a video comes into being: whole segments only, from which a killed job goes on.

`clip.mp4.part` stands beside `clip.mp4` until that is whole. It holds `frames/`, the segments (a clip of some frames
that plays, or a picture for each frame), `job.json`, what the job was asked for, and `states.txt`, fingerprints
of the simulation, against which a job that goes on is checked.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from ripple_sim.errors import VideoError

_SETTINGS, _STATES, _FRAMES, _WHOLE = "settings.json", "states.txt", "frames", "whole"
_STATE = re.compile(r"(\d+) ([0-9a-f]+);")  # with an end, since a killed process may have cut it off


class Part:
    """The folder of one video, locked against other processes.

    Parameters
    ----------
    video : path
        Where the video will stand.
    suffix : str
        Ending of its segments.
    length : int
        Frames in a segment.
    job : mapping
        What the video is made of and how, by name: words and numbers.
    resume : bool
        Go on with what is there, if anything is. Otherwise it is removed.

    Raises
    ------
    VideoError
        If another process is writing this video, the folder holds anything else, or what is there is of another job.
    OSError
        If the folder cannot be written.

    Attributes
    ----------
    frames : int
        How many are stored.
    """

    def __init__(
        self, video: Path, *, suffix: str, length: int, settings: Mapping[str, str | int | float], resume: bool
    ) -> None:
        self.video = video
        self.folder = video.with_name(video.name + ".part")
        self._suffix, self._length = suffix, length
        self._segments = self.folder / _FRAMES
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock = os.open(self.folder, os.O_RDONLY)
        try:
            self._claim()
            old = self._read_settings() if resume else None
            if old is None:
                self._clear()
                self._segments.mkdir()
                self._write_settings(settings)
            else:
                self._compare(old, json.loads(json.dumps(settings)))
                self._drop_unfinished()
            self._states = self._read_states()
        except BaseException:
            os.close(self._lock)
            raise
        self.frames = sum(frames for _, _, frames in self._stored())

    @property
    def unfinished(self) -> Path:
        """Where the next segment is written until it is whole."""
        return self._segments / f".unfinished{self._suffix}"

    @property
    def whole(self) -> Path:
        """Where the video's file is written until it is whole."""
        return self.folder / _WHOLE

    def store(self, frames: int) -> None:
        """Make the unfinished segment, which holds so many frames, one of the whole ones."""
        first = self.frames
        name = f"frame_{first:05d}" if self._length == 1 else f"frames_{first:05d}-{first + frames - 1:05d}"
        move(self.unfinished, self._segments / (name + self._suffix))
        self.frames += frames

    def segments(self) -> list[tuple[Path, int]]:
        """The whole segments, and the number of each one's first frame."""
        return [(path, first) for path, first, _ in self._stored()]

    def check_state(self, frame: int, digest: str) -> None:
        """Note the simulation's fingerprint at a frame, or compare it with the one noted before the job was killed.

        Raises
        ------
        VideoError
            If it is another.
        """
        if frame not in self._states:
            self._states[frame] = digest
            with (self.folder / _STATES).open("a") as file:
                file.write(f"\n{frame} {digest};\n")  # on a line of its own also where the last one was cut off
        elif self._states[frame] != digest:
            raise VideoError(
                f"cannot resume {self.video}: at frame {frame} the simulation is not in the state it was in before; a "
                "hook, a library or the processor has changed: leave --resume out to start anew"
            )

    def finish(self) -> None:
        """Put the whole file, or else the folder of segments, in the video's place, and remove everything else."""
        if self.video.is_dir():  # of frames and nothing else: `check_output` has looked
            shutil.rmtree(self.video)
        move(self.whole if self.whole.exists() else self._segments, self.video)
        self.remove()

    def keep(self) -> bool:
        """Leave the whole segments for later, if there are any, and tell whether there are."""
        if not self.frames:
            self.remove()
            return False
        self._drop_unfinished()
        os.close(self._lock)
        return True

    def remove(self) -> None:
        """Remove everything."""
        shutil.rmtree(self.folder, ignore_errors=True)
        os.close(self._lock)

    def _claim(self) -> None:
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise VideoError(
                f"another process is writing {self.video}; wait until it is done, or name another file"
            ) from error
        strangers = sorted(
            entry.name
            for entry in self.folder.iterdir()
            if entry.name.lstrip(".") not in (_SETTINGS, _STATES, _FRAMES, _WHOLE)
        )
        if strangers:
            raise VideoError(
                f"cannot write {self.video}: its folder {self.folder.name} holds other files ({strangers[0]}); "
                "move it away, or name another file"
            )

    def _clear(self) -> None:
        (self.folder / _SETTINGS).unlink(missing_ok=True)  # first: without it nothing goes on from the rest
        for entry in self.folder.iterdir():
            shutil.rmtree(entry) if entry.is_dir() else entry.unlink()

    def _drop_unfinished(self) -> None:
        self.unfinished.unlink(missing_ok=True)
        self.whole.unlink(missing_ok=True)

    def _read_settings(self) -> dict[str, object] | None:
        path = self.folder / _SETTINGS
        return json.loads(path.read_text()) if path.exists() else None

    def _write_settings(self, settings: Mapping[str, object]) -> None:
        # last: while it is missing there is nothing to go on from
        unfinished = self.folder / f".{_SETTINGS}"
        unfinished.write_text(json.dumps(settings, indent=1))
        move(unfinished, self.folder / _SETTINGS)

    def _compare(self, old: Mapping[str, object], new: Mapping[str, object]) -> None:
        for name in sorted({*old, *new}):
            before, now = old.get(name), new.get(name)
            if before != now:
                raise VideoError(
                    f"cannot resume {self.video}: {name} was {before} and now is {now}; go back to what it was, or "
                    "leave --resume out to start anew"
                )

    def _read_states(self) -> dict[int, str]:
        path = self.folder / _STATES
        lines = path.read_text().splitlines() if path.exists() else []
        return {int(line[1]): line[2] for line in map(_STATE.fullmatch, lines) if line is not None}

    def _stored(self) -> list[tuple[Path, int, int]]:
        """Whole segments in their order, with first frame and number of frames, up to the first that is missing."""
        stored, expected = [], 0
        for path in sorted(self._segments.iterdir(), key=lambda path: (len(path.name), path.name)):
            numbers = re.fullmatch(r"frames?_(\d+)(?:-(\d+))?", path.stem)
            if numbers is None or int(numbers[1]) != expected:
                continue
            frames = int(numbers[2] or numbers[1]) + 1 - expected
            stored.append((path, expected, frames))
            expected += frames
        return stored


def move(source: Path, target: Path) -> None:
    """Rename what is whole, after it has reached the disk."""
    handle = os.open(source, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
    source.replace(target)
