"""Finished scenes of a batch: read from folders and tar files, and packed into tar files."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import shutil
import tarfile
import zipfile
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any

import av
import msgspec
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageSequence

from ripple_sim.encode.locks import locked
from ripple_sim.errors import BatchError
from ripple_sim.export.fields import DTYPES
from ripple_sim.export.tables import COLUMNS
from ripple_sim.solver.files import atomic_write

from .folder import BatchFolder, members, times_of

# Files of a finished scene. The heights hold an array `height_TARGET` for each target,
# [frames, C, n, n] float32 [m], with a chunk for each frame.
HEIGHTS = "heights.zarr.zip"

IMPULSES = "impulses.csv"
POSITIONS = "qpos.npy"
SENSORS = "sensors.npz"
FACTS = "scene.json"
TIMES = "times.json"


def facts_hash(facts: dict[str, Any]) -> str:
    """Hash of the record of a scene, which contains the hashes of its files."""
    return hashlib.blake2b(msgspec.json.encode(facts), digest_size=16).hexdigest()


class FinishedScene:
    """A finished scene of a batch, in a folder or in a tar file.

    In a tar file `members` are the files of the scene, by their names without the scene's number.
    """

    def __init__(
        self, number: int, path: Path, members: dict[str, tarfile.TarInfo] | None = None
    ) -> None:
        self.number = number
        self._path = path
        self._members = members

    def __repr__(self) -> str:
        return f"FinishedScene({self.number})"

    def names(self) -> list[str]:
        """Names of the scene's files; in a tar file with dots instead of slashes."""
        if self._members is not None:
            return sorted(self._members)
        files = [path for path in self._path.rglob("*") if path.is_file()]
        names = sorted(path.relative_to(self._path).as_posix() for path in files)
        return [name for name in names if name != TIMES]

    def read(self, name: str) -> bytes:
        """Content of one of the scene's files; raises `BatchError` with the names of all files."""
        names = self.names()
        if name not in names:
            name_in_tar = name.replace("/", ".")
            if name_in_tar not in names:
                raise BatchError(
                    f"scene {self.number} has no file {name!r}; it has {', '.join(names)}"
                )
            name = name_in_tar
        with self._reported():
            if self._members is None:
                return (self._path / name).read_bytes()
            with self._path.open("rb") as file:
                file.seek(self._members[name].offset_data)
                return file.read(self._members[name].size)

    @contextlib.contextmanager
    def _reported(self) -> Iterator[None]:
        """Turn errors of reading into a `BatchError` that names the scene."""
        try:
            yield
        except BatchError:
            raise
        except Exception as error:  # whatever a damaged file holds
            raise BatchError(
                f"scene {self.number} in {self._path} is damaged: {error}; remove it, and run the "
                "batch again"
            ) from error

    def facts(self) -> dict[str, Any]:
        """The facts: seed, source, values drawn, counts, energies [J], files and their hashes."""
        with self._reported():
            facts = msgspec.json.decode(self.read(FACTS), type=dict[str, Any])
            hashed = {name: value for name, value in facts.items() if name != "hash"}
            if facts["hash"] != facts_hash(hashed):
                raise ValueError(f"{FACTS} is not as it was written")
            return facts

    def times(self) -> dict[str, Any]:
        """How long the scene took [s], and where it was made."""
        is_in_tar = self._members is not None
        path = times_of(self._path) if is_in_tar else self._path / TIMES
        with self._reported():
            content = msgspec.json.decode(path.read_bytes(), type=dict[str, Any])
            times = content[str(self.number)] if is_in_tar else content
            return {
                **times,
                "seconds": float(times["seconds"]),
                "cpu_seconds": float(times["cpu_seconds"]),
            }

    def positions(self) -> NDArray[np.float64]:
        """MuJoCo's generalised positions at every frame, [frames, nq]."""
        with self._reported():
            return np.load(io.BytesIO(self.read(POSITIONS)))

    def heights(self) -> dict[str, NDArray[np.float32]]:
        """The height of each target at every frame [m], [frames, C, n, n]."""
        import zarr
        from zarr.buffer import cpu

        with self._reported():
            with zipfile.ZipFile(io.BytesIO(self.read(HEIGHTS))) as file:
                stored = {name: cpu.Buffer.from_bytes(file.read(name)) for name in file.namelist()}
            group = zarr.open_group(zarr.storage.MemoryStore(stored), mode="r", zarr_format=2)
            return {
                str(array.attrs["target"]): array[...]
                for name, array in group.arrays()
                if name != "time"
            }

    def impulses(self) -> NDArray:
        """The impulses as a structured array.

        Its fields are frame, time, geom, other, x, y, z, impulse, chart, row, column and inner.
        """
        dtype = np.dtype([(name, DTYPES[kind]) for name, (_, kind) in COLUMNS.items()])
        with self._reported():
            lines = list(csv.reader(io.StringIO(self.read(IMPULSES).decode())))[1:]
            return np.array([(*line[:-1], line[-1] == "True") for line in lines], dtype)

    def frames(self) -> Iterator[NDArray[np.uint8]]:
        """The frames of its video or folder of PNG frames, [height, width, 3].

        Raises
        ------
        BatchError
            If there are none, as with EXR frames.
        """
        names = self.names()
        images = [name for name in names if name.startswith("frames") and name.endswith(".png")]
        videos = [name for name in names if name.startswith("video.") and name.count(".") == 1]
        if not images and not videos:
            raise BatchError(
                f"scene {self.number} has no video and no PNG frames; it has {', '.join(names)}"
            )
        with self._reported():
            for name in images or videos[:1]:
                if name.endswith((".mp4", ".webm")):
                    with av.open(io.BytesIO(self.read(name))) as container:
                        for decoded in container.decode(video=0):
                            yield decoded.to_ndarray(format="rgb24")
                elif name.endswith((".png", ".gif", ".webp")):
                    for frame in ImageSequence.Iterator(Image.open(io.BytesIO(self.read(name)))):
                        yield np.asarray(frame.convert("RGB"))

    def passes(self) -> Iterator[dict[str, NDArray]]:
        """The passes of each frame by their names, from .npz files.

        Raises
        ------
        BatchError
            If there are none.
        """
        names = [name for name in self.names() if "passes" in name and name.endswith(".npz")]
        if not names:
            raise BatchError(
                f"scene {self.number} has no passes in .npz files; it has {', '.join(self.names())}"
            )
        with self._reported():
            for name in names:
                with np.load(io.BytesIO(self.read(name))) as arrays:
                    yield {pass_name: arrays[pass_name] for pass_name in arrays.files}


def scenes_in_tar(tar: Path) -> Iterator[FinishedScene]:
    """The scenes in a tar file, in the order of their numbers."""
    for number, files in sorted(members(tar).items()):
        yield FinishedScene(number, tar, files)


def finished_scenes(batch: BatchFolder, known: Container[int] = ()) -> Iterator[FinishedScene]:
    """The finished scenes, each once, without the scenes that are known already."""
    loose = sorted(batch.loose())
    packed: set[int] = set()
    # tar files are read after the folders: a scene that moves into one meanwhile is not missed
    for tar in batch.tar_files():
        for scene in scenes_in_tar(tar):
            packed.add(scene.number)
            if scene.number not in known:
                yield scene
    for number in loose:
        if number not in packed and number not in known:
            yield FinishedScene(number, batch.scene(number))


def pack(batch: BatchFolder, first: int, end: int) -> None:
    """Move the finished scenes from `first` up to `end` (excluded) into one tar file.

    Scenes that are already in the tar file stay in it. The folders are removed when the tar file is
    complete: a call that is killed and repeated loses no scene and packs none twice.
    """
    with locked(batch.work / f"tar-{first:06d}"):
        loose = [number for number in range(first, end) if batch.scene(number).is_dir()]
        if not loose:
            return
        tar = batch.tar(first)
        packed = {}
        if tar.exists():
            packed = {scene.number: scene for scene in scenes_in_tar(tar)}
        new = {number: FinishedScene(number, batch.scene(number)) for number in loose}
        scenes = dict(sorted((packed | new).items()))
        times = {str(number): scene.times() for number, scene in scenes.items()}
        with atomic_write(times_of(tar)) as path:
            path.write_bytes(msgspec.json.encode(times))
        # the tar file appears when it is complete; its bytes do not say who wrote it and when
        with (
            atomic_write(tar) as path,
            tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as file,
        ):
            for number, scene in scenes.items():
                for name in scene.names():
                    # WebDataset takes the part before the first dot as the scene
                    member = tarfile.TarInfo(f"{number:06d}.{name.replace('/', '.')}")
                    content = scene.read(name)
                    member.size = len(content)
                    file.addfile(member, io.BytesIO(content))
        for number in loose:  # other processes see a folder complete or not at all
            hidden = batch.work / f"packed-{number:06d}"
            shutil.rmtree(hidden, ignore_errors=True)  # of a process that was killed
            batch.scene(number).rename(hidden)
            shutil.rmtree(hidden)
