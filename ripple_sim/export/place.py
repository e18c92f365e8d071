"""Where an export goes: whole or not at all, and over nothing foreign; and what writes the files of each ending.

The options of an export are checked here, too, before anything that takes time.
"""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from ripple_sim.encode.output import check_size
from ripple_sim.encode.replace import MARK, check_folder, made_here, move
from ripple_sim.errors import EncodingError, ExportError
from ripple_sim.solver.errors import shown
from ripple_sim.solver.files import NO_NAME, final_path

from .options import TESSELLATIONS, ExportOptions
from .source import Source, Writer

Recognised = Callable[[Path], bool]

MAX_FPS = 1000
LARGEST_MESH = 10_000_000


class Unfinished:
    """A hidden folder beside a path, in which all is written that then moves to its place.

    `path` lies in the folder and has the target's name. What lies beside it there moves to its
    place too, and first. The target is followed where it is a link. `recognised` says whether a
    file or folder at a path was made here; with `overwrite` what was not is replaced, but never a
    folder of other things.
    """

    def __init__(self, target: Path, recognised: Recognised, overwrite: bool) -> None:
        self._target = final_path(target)
        self._recognised = recognised
        self._overwrite = overwrite
        name = self._target.name
        parent = self._target.parent
        parent.mkdir(parents=True, exist_ok=True)
        self._folder = Path(tempfile.mkdtemp(prefix=f".{name[:100]}.", suffix=".part", dir=parent))
        self.path = self._folder / name

    def finish(self) -> None:
        """Move everything to its place, unless something foreign stands there by now."""
        # again: a run takes long
        _check_replaceable(self._target, self._recognised, self._overwrite)
        made = {".png": made_here, ".usdc": self._recognised}

        def own(file: Path) -> bool:
            return file.suffix in made and (self._overwrite or made[file.suffix](file))

        written = sorted(self._folder.iterdir(), key=lambda each: each == self.path)
        for each in written[:-1]:  # folders of images or chunks
            check_folder(
                ExportError, each.suffix.removeprefix("."), self._target.with_name(each.name), own
            )
        for each in written:
            target = self._target.with_name(each.name)
            if target.is_dir():
                shutil.rmtree(target)
            move(each, target)

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        shutil.rmtree(self._folder, ignore_errors=True)


def _check_replaceable(path: Path, recognised: Recognised, overwrite: bool) -> None:
    if path.is_dir():
        if not recognised(path):
            raise ExportError(
                f"cannot write {path}: it is a folder of other things; name another output"
            )
    elif path.exists():
        if not path.is_file():
            raise ExportError(
                f"cannot write {path}: it exists and is not a file; name another output"
            )
        if path.stat().st_size and not overwrite and not recognised(path):
            raise ExportError(
                f"cannot write {path}: it exists and was not {MARK}; name another file, or add "
                f"--overwrite"
            )


@dataclasses.dataclass(frozen=True)
class Ending:
    """How the files of an ending are written.

    Attributes
    ----------
    home, kind : str
        Module, below this package, and its class that writes the files; `made_here` of the module
        tells them.
    package, extra : str, optional
        What it needs beside ripple-sim, and the extra that brings it.
    chunks : bool
        Whether a run can be divided over files.
    """

    home: str
    kind: str
    package: str | None = None
    extra: str | None = None
    chunks: bool = False

    def writer(self, source: Source, path: Path) -> Writer:
        """Begin a file."""
        return getattr(importlib.import_module(self.home, __package__), self.kind)(source, path)

    def made_here(self, path: Path) -> bool:
        """Whether a file of this ending was written here."""
        return importlib.import_module(self.home, __package__).made_here(path)


_LAYER = Ending(".usd", "UsdWriter", package="pxr", extra="usd", chunks=True)
ENDINGS = {
    ".usdc": _LAYER,
    ".usda": _LAYER,
    ".usdz": dataclasses.replace(_LAYER, chunks=False),
    ".zarr": Ending(".fields", "FieldWriter", package="zarr", extra="zarr"),
    ".html": Ending(".page", "PageWriter"),
    ".csv": Ending(".tables", "CsvWriter"),
    ".parquet": Ending(".tables", "ParquetWriter", package="pyarrow", extra="parquet"),
    ".wav": Ending(".wav", "WavWriter"),
}


def ending_of(path: Path) -> Ending:
    """How a path's file is written; raises `ExportError` if its ending is unknown, or needs what is not installed."""
    suffix = path.suffix.lower()
    if path.name.lower() in ENDINGS or suffix not in ENDINGS:
        problem = f"ends in {path.suffix}" if path.suffix else "has no ending"
        raise ExportError(
            f"output {str(path)!r} {problem}; valid is a name that ends in {', '.join(ENDINGS)}"
        )
    ending = ENDINGS[suffix]
    if ending.package is not None and importlib.util.find_spec(ending.package) is None:
        raise ExportError(
            f"{suffix} files need {ending.package}, which is not installed; install it with: "
            f"pip install 'ripple-sim[{ending.extra}]'"
        )
    return ending


def check_export(path: Path, overwrite: bool, *, chunked: bool = False) -> Ending:
    """Make sure, before anything that takes time, that an export can be written to a path; return how. Leaves nothing.

    Raises
    ------
    ExportError
        If the ending is unknown, needs what is not installed, has no chunks where they are wanted,
        or is another where a link leads; something foreign stands in the path's place, or there can
        be no such name.
    EncodingError
        If nothing can be written there.
    """
    ending = ending_of(path)
    if chunked and not ending.chunks:
        able = " and ".join(suffix for suffix, each in ENDINGS.items() if each.chunks)
        raise ExportError(
            f"there are chunks of {able} files alone, not of {path.name}; leave chunk out"
        )
    try:
        final = final_path(path)
        # what is written there, and told again, goes by the ending
        if final.suffix.lower() != path.suffix.lower():
            raise ExportError(
                f"output {str(path)!r} is a link to {final.name!r}; valid is a link to a name that "
                f"ends in "
                f"{path.suffix}"
            )
        _check_replaceable(final, ending.made_here, overwrite)
        with tempfile.TemporaryFile(dir=next(each for each in final.parents if each.exists())):
            return ending
    except OSError as error:
        kind = ExportError if error.errno in NO_NAME else EncodingError
        raise kind(
            f"cannot write {path}: {error.strerror}; name a file in a folder you can write to"
        ) from error


def check_options(options: ExportOptions) -> None:
    """Make sure that the options are possible, before anything that takes time; raises `RippleError`."""
    if options.fps > MAX_FPS:
        raise ExportError(
            f"frame rate is {options.fps!r}; valid is a whole number from 1 to {MAX_FPS} frames a "
            f"second"
        )
    if options.resume and options.chunk is None:
        raise ExportError(
            "only an export in chunks can be resumed; add --chunk, or leave --resume out"
        )
    check_written(options.size, options.tessellation, options.triangles, options.chunk)


def check_written(
    size: tuple[int, int], tessellation: str, triangles: int, chunk: int | None
) -> None:
    """Make sure that options of an export in anybody's own loop are possible; raises `RippleError`."""
    check_size(*size)
    if not isinstance(triangles, int) or not 1 <= triangles <= LARGEST_MESH:
        raise ExportError(
            f"there shall be {shown(triangles)} triangles; valid is a whole number, 1 to "
            f"{LARGEST_MESH}"
        )
    if chunk is not None and (not isinstance(chunk, int) or chunk < 1):
        raise ExportError(
            f"a chunk shall have {shown(chunk)} frames; valid is a whole number from 1"
        )
    if tessellation not in TESSELLATIONS:
        raise ExportError(
            f"tessellation is {shown(tessellation)}; valid are "
            f"{' and '.join(map(repr, TESSELLATIONS))}"
        )
