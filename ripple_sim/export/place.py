"""Where an export goes: whole or not at all, and over nothing foreign."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from ripple_sim.encode.mark import MARK, made_here
from ripple_sim.encode.move import move
from ripple_sim.errors import EncodingError, ExportError
from ripple_sim.solver.files import NO_NAME, final_path

Recognised = Callable[[Path], bool]


def check_place(path: Path, recognised: Recognised, overwrite: bool) -> None:
    """Make sure that an export may be written to a path; leave nothing behind.

    Parameters
    ----------
    path : Path
    recognised : callable
        Whether a file or folder at a path was made here.
    overwrite : bool
        Replace what was not, but never a folder of other things.

    Raises
    ------
    ExportError
        If something foreign stands there, or there can be no such name.
    EncodingError
        If nothing can be written there.
    """
    try:
        final = final_path(path)
        _check_replaceable(final, recognised, overwrite)
        with tempfile.TemporaryFile(dir=_existing(final.parent)):
            pass
    except OSError as error:
        kind = ExportError if error.errno in NO_NAME else EncodingError
        raise kind(f"cannot write {path}: {error.strerror}; name a file in a folder you can write to") from error


class Unfinished:
    """A hidden folder beside a path, in which all is written that then moves to its place.

    Parameters
    ----------
    target : Path
        Followed where it is a link.
    recognised : callable
    overwrite : bool
        As for `check_place`.

    Attributes
    ----------
    path : Path
        In the folder, of the target's name. What lies beside it there moves to its place too, and first.
    """

    def __init__(self, target: Path, recognised: Recognised, overwrite: bool) -> None:
        self._target, self._recognised, self._overwrite = final_path(target), recognised, overwrite
        name, parent = self._target.name, self._target.parent
        parent.mkdir(parents=True, exist_ok=True)
        self._folder = Path(tempfile.mkdtemp(prefix=f".{name[:100]}.", suffix=".part", dir=parent))
        self.path = self._folder / name

    def finish(self) -> None:
        """Move everything to its place, unless something foreign stands there by now."""
        _check_replaceable(self._target, self._recognised, self._overwrite)  # again: a run takes long
        written = sorted(self._folder.iterdir(), key=lambda each: each == self.path)
        for each in written[:-1]:
            check_companion(self._target.with_name(each.name), self._recognised, self._overwrite)
        for each in written:
            target = self._target.with_name(each.name)
            if target.is_dir():
                shutil.rmtree(target)
            move(each, target)

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        shutil.rmtree(self._folder, ignore_errors=True)


def check_companion(folder: Path, recognised: Recognised, overwrite: bool) -> None:
    """Make sure that a folder of images or chunks that belongs to an export may be replaced.

    Raises
    ------
    ExportError
        If it holds anything but those that were made here.
    """
    what = folder.suffix.removeprefix(".")
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise ExportError(f"cannot write {what} to {folder}: it is not a folder; name another output")
    for each in folder.iterdir() if folder.is_dir() else ():
        plain = each.is_file() and not each.is_symlink()
        image = plain and each.suffix == ".png" and (overwrite or made_here(each))
        if not image and not (plain and each.suffix == ".usdc" and (overwrite or recognised(each))):
            raise ExportError(
                f"cannot write {what} to {folder}: it holds other files ({each.name}); name another output"
            )


def _check_replaceable(path: Path, recognised: Recognised, overwrite: bool) -> None:
    if path.is_dir():
        if not recognised(path):
            raise ExportError(f"cannot write {path}: it is a folder of other things; name another output")
    elif path.exists():
        if not path.is_file():
            raise ExportError(f"cannot write {path}: it exists and is not a file; name another output")
        if path.stat().st_size and not overwrite and not recognised(path):
            raise ExportError(
                f"cannot write {path}: it exists and was not {MARK}; name another file, or add --overwrite"
            )


def _existing(folder: Path) -> Path:
    while not folder.exists():
        folder = folder.parent
    return folder
