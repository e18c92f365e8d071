"""The file of an atlas, for users and the cache: an uncompressed NumPy archive, verified."""

from __future__ import annotations

import struct
import zipfile
import zlib
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from ..errors import AtlasError
from ..files import atomic_write, final_path

# Version of the file format. Raise it when a layout's map or the contents of the file change: then
# the cache rebuilds its atlases.
FORMAT = 19

# Oldest version that is read: the format of 1.0.0, as `docs/stability.md` says.
OLDEST = 13

# What to do about a file that cannot be read.
ADVICE = "make it again with `ripple-sim atlas MESH -o FILE`"

# Arrays that every atlas file has.
_NEEDED = {
    "V",
    "F",
    "kind",
    "format",
    "glued",
    "positions",
    "normals",
    "areas",
    "triangles",
    "barycentrics",
}

# Arrays of indices, which the file has in 32 bits.
_INDICES = {"F", "triangles", "glued", "charts", "piece_triangle", "piece_chart"}

# Errors of a damaged archive.
_DAMAGE = (
    zipfile.BadZipFile,
    EOFError,
    MemoryError,
    OSError,
    RuntimeError,
    struct.error,
    zlib.error,
)


def write_arrays(file: BinaryIO, arrays: dict[str, NDArray]) -> None:
    """Write an archive that `read_arrays` and `numpy.load` read."""
    np.savez(file, allow_pickle=False, **arrays)


def read_arrays(path: Path) -> dict[str, NDArray]:
    """Read all arrays of an archive, and compare each with its checksum.

    Raises
    ------
    ValueError
        If the file is damaged, or is not such an archive.
    OSError
        If it cannot be read.
    """
    arrays = {}
    with path.open("rb") as file:
        try:
            with zipfile.ZipFile(file) as archive:
                for name in archive.namelist():
                    with archive.open(name) as member:
                        arrays[name.removesuffix(".npy")] = npy.read_array(
                            member, allow_pickle=False
                        )
                        if member.read(1):  # the checksum is compared at the end
                            raise ValueError(f"{name!r} is damaged")
        except _DAMAGE as error:
            raise ValueError(str(error)) from error
    return arrays


def write_atlas_file(path: Path, arrays: dict[str, NDArray]) -> None:
    """Write an atlas's arrays; the file appears whole or not at all.

    Raises `AtlasError` if the file cannot be written.
    """
    small = {name: arrays[name].astype(np.int32) for name in _INDICES & arrays.keys()}
    try:
        with atomic_write(path) as unfinished, unfinished.open("wb") as file:
            write_arrays(file, {**arrays, **small, "format": np.array([FORMAT])})
    except OSError as error:
        raise AtlasError(
            f"atlas file {str(path)!r} cannot be written: {error.strerror or error}"
        ) from error


def check_atlas_place(path: Path, overwrite: bool) -> None:
    """Make sure that an atlas may be written to a path.

    Raises `AtlasError` if there can be no such name, or if there is a file that is no atlas. An
    empty file is replaced, and any file with `overwrite`.
    """
    try:
        final_path(path)
    except OSError as error:
        raise AtlasError(
            f"atlas file {str(path)!r} cannot be written: {error.strerror}; name another file"
        ) from error
    if overwrite or not path.is_file() or path.stat().st_size == 0:
        return
    try:
        with zipfile.ZipFile(path) as archive:
            known = {"format.npy", "positions.npy"} <= set(archive.namelist())
    except (OSError, zipfile.BadZipFile, NotImplementedError, struct.error):
        known = False
    if not known:
        raise AtlasError(
            f"atlas file {str(path)!r} cannot be written: it exists and is no atlas; name another "
            "file, or ask to overwrite it"
        )


def read_atlas_file(path: Path) -> dict[str, NDArray]:
    """Read the arrays of an atlas.

    Raises `AtlasError` if the file is missing, truncated, changed, or of a version before 1.0.0 or
    after this one.
    """
    try:
        if not path.is_file():
            problem = "is not a file" if path.exists() else "does not exist"
            raise AtlasError(
                f"atlas file {str(path)!r} {problem}; make one with `ripple-sim atlas MESH -o FILE`"
            )
        arrays = read_arrays(path)
    except (OSError, ValueError) as error:
        raise AtlasError(
            f"atlas file {str(path)!r} is damaged or not an atlas ({error}); {ADVICE}"
        ) from error
    is_complete = arrays.keys() >= _NEEDED
    readable_formats = [[number] for number in range(OLDEST, FORMAT + 1)]
    if not is_complete or arrays["format"].tolist() not in readable_formats:
        raise AtlasError(
            f"atlas file {str(path)!r} is not an atlas, or of another version; {ADVICE}"
        )
    indices = {name: arrays[name].astype(np.int64) for name in _INDICES & arrays.keys()}
    return arrays | indices
