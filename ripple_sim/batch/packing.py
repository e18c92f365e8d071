"""Finished scenes put into tar files."""

from __future__ import annotations

import contextlib
import fcntl
import shutil
from collections.abc import Iterator
from pathlib import Path

import msgspec

from ripple_sim.solver.files import atomic_write

from .finished import FinishedScene, FolderFiles, scenes_in_tar
from .folder import BatchFolder
from .tars import member_name, times_of, write_tar


def pack(batch: BatchFolder, first: int, end: int) -> None:
    """Move the finished scenes from `first` to before `end` into one tar file, beside those that are there already.

    Killed at any time and called again, it loses and doubles nothing: folders go when the tar file is there.
    """
    with _locked(batch.work / f"tar-{first:06d}"):
        loose = [number for number in range(first, end) if batch.scene(number).is_dir()]
        if not loose:
            return
        tar = batch.tar(first)
        before = {each.number: each for each in scenes_in_tar(tar)} if tar.exists() else {}
        now = {number: FinishedScene(number, FolderFiles(batch.scene(number))) for number in loose}
        scenes = dict(sorted((before | now).items()))
        times = {str(number): scene.times() for number, scene in scenes.items()}
        with atomic_write(times_of(tar)) as path:
            path.write_bytes(msgspec.json.encode(times))
        write_tar(tar, _files(scenes))
        for number in loose:
            _remove_whole(batch.scene(number), batch.work / f"packed-{number:06d}")


def _files(scenes: dict[int, FinishedScene]) -> Iterator[tuple[str, bytes]]:
    for number, scene in scenes.items():
        for name in scene.names():
            yield member_name(number, name), scene.read(name)


def _remove_whole(folder: Path, hidden: Path) -> None:
    """Remove a folder of which others shall see everything or nothing."""
    shutil.rmtree(hidden, ignore_errors=True)  # of a process that was killed
    folder.rename(hidden)
    shutil.rmtree(hidden)


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    """One process at a time."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
