"""The endings of exports: what writes each, what it needs, and how a file of it is known again."""

from __future__ import annotations

import dataclasses
import importlib
import importlib.util
from pathlib import Path

from ripple_sim.errors import ExportError

from .place import check_place
from .source import Source, Writer


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


_LAYER = Ending(".usd_file", package="pxr", extra="usd", chunks=True)
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
