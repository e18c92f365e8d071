"""The place of an export: written whole or not at all, never over foreign files.

`ENDINGS` lists the writers of the formats. This module also checks the options of an export, before
any long work.
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

from .options import MESH_FORMATS, TESSELLATIONS, ExportOptions
from .source import Source, Writer

Recognised = Callable[[Path], bool]

MAX_FPS = 1000  # frames per second
LARGEST_MESH = 10_000_000  # triangles of a refined surface, at most


class Unfinished:
    """A hidden folder beside a target: an export is written there and then moved.

    Parameters
    ----------
    target : path
        A link is followed.
    recognised : callable
        Whether a file or folder at a path was made by ripple-sim.
    overwrite : bool
        Replace a file that was not made by ripple-sim; a folder of other things is never replaced.

    Attributes
    ----------
    path : Path
        The unfinished file in the folder; it has the target's name. Files beside it are moved to
        their places first.
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
        """Move everything to its place, unless a foreign file has appeared there."""
        # a second check, since a run takes long
        _check_replaceable(self._target, self._recognised, self._overwrite)
        recognised = {".png": made_here, ".usdc": self._recognised}

        def is_replaceable(file: Path) -> bool:
            if file.suffix not in recognised:
                return False
            return self._overwrite or recognised[file.suffix](file)

        # the target itself comes last
        written = sorted(self._folder.iterdir(), key=lambda path: path == self.path)
        for folder in written[:-1]:  # of images or chunks
            kind = folder.suffix.removeprefix(".")
            check_folder(ExportError, kind, self._target.with_name(folder.name), is_replaceable)
        for path in written:
            target = self._target.with_name(path.name)
            if target.is_dir():
                shutil.rmtree(target)
            move(path, target)

    def remove(self) -> None:
        """Remove the folder and its contents."""
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
        Module of this package, and its class that writes the files; `made_here` of the module
        recognises them.
    package, extra : str, optional
        Package that the writer needs, and the extra of ripple-sim that installs it.
    chunks : bool
        Whether a run can be divided over files.
    meshes : bool
        Whether the files are meshes, whose surfaces may have the colours of their heights.
    one_time : bool
        Whether a file shows one time alone.
    """

    home: str
    kind: str
    package: str | None = None
    extra: str | None = None
    chunks: bool = False
    meshes: bool = False
    one_time: bool = False

    def writer(self, source: Source, path: Path) -> Writer:
        """Begin a file."""
        return getattr(importlib.import_module(self.home, __package__), self.kind)(source, path)

    def made_here(self, path: Path) -> bool:
        """Whether a file of this ending was written here."""
        return importlib.import_module(self.home, __package__).made_here(path)


_LAYER = Ending(".usd", "UsdWriter", package="pxr", extra="usd", chunks=True)
_MESH = Ending(".mesh_files", "MeshWriter", meshes=True, one_time=True)
ENDINGS = {
    ".usdc": _LAYER,
    ".usda": _LAYER,
    ".usdz": dataclasses.replace(_LAYER, chunks=False),
    ".zarr": Ending(".fields", "FieldWriter", package="zarr", extra="zarr"),
    ".html": Ending(".page", "PageWriter"),
    ".csv": Ending(".tables", "CsvWriter"),
    ".parquet": Ending(".tables", "ParquetWriter", package="pyarrow", extra="parquet"),
    ".wav": Ending(".wav", "WavWriter"),
    ".ply": _MESH,
    ".glb": _MESH,
    ".meshes": Ending(".mesh_files", "MeshFolderWriter", meshes=True),
}


def ending_of(path: Path) -> Ending:
    """How the file of a path is written.

    Raises `ExportError` if its ending is unknown, or needs a package that is not installed.
    """
    suffix = path.suffix.lower()
    if path.name.lower() in ENDINGS or suffix not in ENDINGS:
        problem = f"ends in {path.suffix}" if path.suffix else "has no ending"
        raise ExportError(
            f"output {str(path)!r} {problem}: it must be a name that ends in {', '.join(ENDINGS)}"
        )
    ending = ENDINGS[suffix]
    if ending.package is not None and importlib.util.find_spec(ending.package) is None:
        raise ExportError(
            f"{suffix} files need {ending.package}, which is not installed; install it with: "
            f"pip install 'ripple-sim[{ending.extra}]'"
        )
    return ending


def check_export(
    path: Path,
    overwrite: bool,
    *,
    chunked: bool = False,
    timed: bool = False,
    colored: bool = False,
) -> Ending:
    """Check that an export can be written to a path, and return how; leave no file.

    Call it before anything that takes time.

    Parameters
    ----------
    path : Path
    overwrite : bool
    chunked, timed, colored : bool
        Whether the files shall be chunks of a run, show one time, or have colours by height.

    Raises
    ------
    ExportError
        If the ending is unknown, needs a package that is not installed, does not support the
        options, or differs from that of a link's target; if a foreign file is in the place, or the
        name is impossible.
    EncodingError
        If nothing can be written there.
    """
    ending = ending_of(path)
    # whether an option is requested, the attribute of endings that support it, and its name
    for is_requested, attribute, option in (
        (chunked, "chunks", "chunk"),
        (timed, "one_time", "time"),
        (colored, "meshes", "height_colors"),
    ):
        if is_requested and not getattr(ending, attribute):
            supporting = [suffix for suffix in ENDINGS if getattr(ENDINGS[suffix], attribute)]
            raise ExportError(
                f"{option} is only for {', '.join(supporting)}, not for {path.name}; leave it out"
            )
    try:
        final = final_path(path)
        # the ending chooses the writer and `made_here`
        if final.suffix.lower() != path.suffix.lower():
            raise ExportError(
                f"output {str(path)!r} is a link to {final.name!r}: it must be a link to a name "
                f"that ends in {path.suffix}"
            )
        _check_replaceable(final, ending.made_here, overwrite)
        folder = next(parent for parent in final.parents if parent.exists())
        with tempfile.TemporaryFile(dir=folder):
            return ending
    except OSError as error:
        kind = ExportError if error.errno in NO_NAME else EncodingError
        raise kind(
            f"cannot write {path}: {error.strerror}; name a file in a folder you can write to"
        ) from error


def check_options(options: ExportOptions) -> None:
    """Check the options of an export, before anything that takes time; raise `RippleError`."""
    if options.fps > MAX_FPS:
        raise ExportError(
            f"frame rate must be a whole number from 1 to {MAX_FPS} frames a second, got "
            f"{options.fps!r}"
        )
    if options.resume and options.chunk is None:
        raise ExportError(
            "only an export in chunks can be resumed; add --chunk, or leave --resume out"
        )
    check_written(options.size, options.tessellation, options.triangles, options.chunk)


def check_written(
    size: tuple[int, int], tessellation: str, triangles: int, chunk: int | None
) -> None:
    """Check the options of an export in a user's loop; raise `RippleError`."""
    check_size(*size)
    if not isinstance(triangles, int) or not 1 <= triangles <= LARGEST_MESH:
        raise ExportError(
            f"triangles must be a whole number from 1 to {LARGEST_MESH}, got {shown(triangles)}"
        )
    if chunk is not None and (not isinstance(chunk, int) or chunk < 1):
        raise ExportError(f"frames of a chunk must be a whole number from 1, got {shown(chunk)}")
    if tessellation not in TESSELLATIONS:
        raise ExportError(
            f"tessellation must be one of {', '.join(map(repr, TESSELLATIONS))}, got "
            f"{shown(tessellation)}"
        )


def check_mesh_format(mesh_format: str) -> None:
    """Check the format of the files in a folder of meshes; raise `ExportError`."""
    if mesh_format not in MESH_FORMATS:
        raise ExportError(
            f"mesh_format must be {' or '.join(map(repr, MESH_FORMATS))}, got {shown(mesh_format)}"
        )
