"""Where an export goes: whole or not at all, and over nothing foreign; and what writes the files of each ending."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from ripple_sim.encode.replace import MARK, made_here, move
from ripple_sim.errors import EncodingError, ExportError
from ripple_sim.solver.files import NO_NAME, final_path

from .source import Source, Writer

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


@dataclasses.dataclass(frozen=True)
class Ending:
    """How the files of an ending are written.

    Attributes
    ----------
    home : str
        Module, below this package, that has `writer` and `made_here`.
    package, extra : str, optional
        What it needs beside ripple-sim, and the extra that brings it.
    chunks : bool
        Whether a run can be divided over files.
    """

    home: str
    package: str | None = None
    extra: str | None = None
    chunks: bool = False

    def writer(self, source: Source, path: Path) -> Writer:
        """Begin a file."""
        return importlib.import_module(self.home, __package__).writer(source, path)

    def made_here(self, path: Path) -> bool:
        """Whether a file of this ending was written here."""
        return importlib.import_module(self.home, __package__).made_here(path)


_LAYER = Ending(".usd", package="pxr", extra="usd", chunks=True)
ENDINGS = {
    ".usdc": _LAYER,
    ".usda": _LAYER,
    ".usdz": dataclasses.replace(_LAYER, chunks=False),
    ".zarr": Ending(".fields", package="zarr", extra="zarr"),
    ".html": Ending(".page"),
    ".csv": Ending(".tables"),
    ".parquet": Ending(".tables", package="pyarrow", extra="parquet"),
}


def ending_of(path: Path) -> Ending:
    """How a path's file is written.

    Raises
    ------
    ExportError
        If its ending is unknown, or needs what is not installed.
    """
    suffix = path.suffix.lower()
    if path.name.lower() in ENDINGS or suffix not in ENDINGS:
        problem = f"ends in {path.suffix}" if path.suffix else "has no ending"
        raise ExportError(f"output {str(path)!r} {problem}; valid is a name that ends in {', '.join(ENDINGS)}")
    ending = ENDINGS[suffix]
    if ending.package is not None and importlib.util.find_spec(ending.package) is None:
        raise ExportError(
            f"{suffix} files need {ending.package}, which is not installed; install it with: "
            f"pip install 'ripple-sim[{ending.extra}]'"
        )
    return ending


def check_export(path: Path, overwrite: bool, *, chunked: bool = False) -> Ending:
    """Make sure, before anything that takes time, that an export can be written to a path; return how.

    Raises
    ------
    ExportError
        If the ending is unknown, needs what is not installed, has no chunks where they are wanted, or something foreign
        stands in the path's place.
    EncodingError
        If nothing can be written there.
    """
    ending = ending_of(path)
    if chunked and not ending.chunks:
        able = " and ".join(suffix for suffix, each in ENDINGS.items() if each.chunks)
        raise ExportError(f"there are chunks of {able} files alone, not of {path.name}; leave --chunk out")
    check_place(path, ending.made_here, overwrite)
    return ending
