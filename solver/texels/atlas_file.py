"""Atlases on disk: one verified file format, for users and for the cache."""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..atomic_file import atomic_write, final_path
from ..errors import AtlasError
from .array_file import read_arrays, write_arrays

# Raise it when a layout's map or the file's contents change: older files are rebuilt.
FORMAT = 13
ADVICE = "make it again with `ripple-sim atlas MESH -o FILE`"

_NEEDED = {"V", "F", "kind", "format", "glued", "positions", "normals", "areas", "triangles", "barycentrics"}
_INDICES = {"F", "triangles", "glued", "charts", "piece_triangle", "piece_chart"}  # in 32 bits


def write_atlas_file(path: Path, arrays: dict[str, NDArray]) -> None:
    """Write an atlas's arrays; the file appears whole or not at all.

    Raises
    ------
    AtlasError
        If the file cannot be written.
    """
    small = {name: arrays[name].astype(np.int32) for name in _INDICES & arrays.keys()}
    try:
        with atomic_write(path) as unfinished, unfinished.open("wb") as file:
            write_arrays(file, {**arrays, **small, "format": np.array([FORMAT])})
    except OSError as error:
        raise AtlasError(f"atlas file {str(path)!r} cannot be written: {error.strerror or error}") from error


def check_atlas_place(path: Path, overwrite: bool) -> None:
    """Make sure that an atlas may be written to a path.

    Raises
    ------
    AtlasError
        If there can be no such name, or another file is there, unless it is empty or `overwrite` says that it is to go.
    """
    try:
        final_path(path)
    except OSError as error:
        raise AtlasError(f"atlas file {str(path)!r} cannot be written: {error.strerror}; name another file") from error
    if overwrite or not path.is_file() or path.stat().st_size == 0:
        return
    try:
        with zipfile.ZipFile(path) as archive:
            known = {"format.npy", "positions.npy"} <= set(archive.namelist())
    except (OSError, zipfile.BadZipFile, NotImplementedError, struct.error):
        known = False
    if not known:
        raise AtlasError(
            f"atlas file {str(path)!r} cannot be written: it exists and is no atlas; name another file, or "
            "ask to overwrite it"
        )


def read_atlas_file(path: Path) -> dict[str, NDArray]:
    """Read the arrays of an atlas.

    Raises
    ------
    AtlasError
        If the file is missing, truncated, changed, or not an atlas of this version.
    """
    try:
        if not path.is_file():
            problem = "is not a file" if path.exists() else "does not exist"
            raise AtlasError(f"atlas file {str(path)!r} {problem}; make one with `ripple-sim atlas MESH -o FILE`")
        arrays = read_arrays(path)
    except (OSError, ValueError) as error:
        raise AtlasError(f"atlas file {str(path)!r} is damaged or not an atlas ({error}); {ADVICE}") from error
    if _NEEDED - arrays.keys() or arrays["format"].tolist() != [FORMAT]:
        raise AtlasError(f"atlas file {str(path)!r} is not an atlas, or of another version; {ADVICE}")
    return arrays | {name: arrays[name].astype(np.int64) for name in _INDICES & arrays.keys()}
