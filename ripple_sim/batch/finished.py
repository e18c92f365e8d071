"""A finished scene and its files, in a folder or in a tar file."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from tarfile import TarInfo
from typing import Any, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import BatchError
from ripple_sim.export.tables import COLUMNS

from .height_store import HEIGHTS, read_heights
from .records import IMPULSES, POSITIONS
from .stored_frames import stored_frames, stored_passes
from .tars import members, times_of

FACTS, TIMES = "scene.json", "times.json"

_KINDS = {"int64": "i8", "float64": "f8", "bool": "?", "string": "U64"}


class Files(Protocol):
    """Where the files of a scene are."""

    def names(self) -> list[str]:
        """Their names, with slashes for folders, or dots in a tar file."""

    def read(self, name: str) -> bytes:
        """Content of a file."""

    def times(self) -> dict[str, Any]:
        """Who made the scene, and how long it took."""


class FolderFiles:
    """Files in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def names(self) -> list[str]:
        """Their names, with slashes for folders."""
        found = sorted(path.relative_to(self.folder).as_posix() for path in self.folder.rglob("*") if path.is_file())
        return [name for name in found if name != TIMES]

    def read(self, name: str) -> bytes:
        """Content of a file."""
        return (self.folder / name).read_bytes()

    def times(self) -> dict[str, Any]:
        """Who made the scene, and how long it took."""
        return msgspec.json.decode((self.folder / TIMES).read_bytes())


class TarFiles:
    """Files in a tar file, by the parts of their names behind the scene's number."""

    def __init__(self, tar: Path, number: int, found: dict[str, TarInfo]) -> None:
        self.tar, self.number, self._members = tar, number, found

    def names(self) -> list[str]:
        """Their names, with dots for folders."""
        return sorted(self._members)

    def read(self, name: str) -> bytes:
        """Content of a file."""
        member = self._members[name]
        with self.tar.open("rb") as file:
            file.seek(member.offset_data)
            return file.read(member.size)

    def times(self) -> dict[str, Any]:
        """Who made the scene, and how long it took."""
        return msgspec.json.decode(times_of(self.tar).read_bytes())[str(self.number)]


class FinishedScene:
    """A scene of a batch.

    Attributes
    ----------
    number : int
    """

    def __init__(self, number: int, files: Files) -> None:
        self.number, self._files = number, files

    def __repr__(self) -> str:
        return f"FinishedScene({self.number})"

    def names(self) -> list[str]:
        """Names of its files; in a tar file with dots in place of slashes."""
        return self._files.names()

    def read(self, name: str) -> bytes:
        """Content of one of its files; raises `BatchError` with the names of all."""
        for given in (name, name.replace("/", ".")):
            if given in self.names():
                return self._files.read(given)
        raise BatchError(f"scene {self.number} has no file {name!r}; it has {', '.join(self.names())}")

    def facts(self) -> dict[str, Any]:
        """What is known of it: seed, source, values drawn, counts, energies [J], files and their hashes."""
        return msgspec.json.decode(self.read(FACTS))

    def times(self) -> dict[str, Any]:
        """How long it took [s], and where it was made."""
        return self._files.times()

    def positions(self) -> NDArray[np.float64]:
        """MuJoCo's generalised positions at every frame, [frames, nq]."""
        return np.load(io.BytesIO(self.read(POSITIONS)))

    def heights(self) -> dict[str, NDArray[np.float32]]:
        """The height of each target at every frame [m], [frames, C, n, n]."""
        return read_heights(self.read(HEIGHTS))

    def impulses(self) -> NDArray:
        """The impulses, a structured array: frame, time, geom, other, x, y, z, impulse, chart, row, column, inner."""
        lines = list(csv.reader(io.StringIO(self.read(IMPULSES).decode())))[1:]
        dtype = np.dtype([(name, _KINDS[kind]) for name, (_, kind) in COLUMNS.items()])
        return np.array([(*line[:-1], line[-1] == "True") for line in lines], dtype)

    def frames(self) -> Iterator[NDArray[np.uint8]]:
        """The frames of its video, [height, width, 3]; of EXR frames there are none."""
        yield from stored_frames(self)

    def passes(self) -> Iterator[dict[str, NDArray]]:
        """The passes of each frame by their names, from .npz files."""
        yield from stored_passes(self)


def scenes_in_tar(tar: Path) -> Iterator[FinishedScene]:
    """The scenes in a tar file, in the order of their numbers."""
    for number, found in sorted(members(tar).items()):
        yield FinishedScene(number, TarFiles(tar, number, found))
