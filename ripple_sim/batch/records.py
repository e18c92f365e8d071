"""What is recorded of a running scene beside its frames: impulses, heights, positions, energies."""

from __future__ import annotations

import csv
import hashlib
import io
import re
import shutil
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray

from ripple_sim.export.source import Moment
from ripple_sim.export.tables import HEADER, rows
from ripple_sim.simulation import Simulation

from .plan import StoreEntry

HEIGHTS = "heights.zarr.zip"

_ALWAYS = (1980, 1, 1, 0, 0, 0)  # the time of every file in the zip file: the same heights, the same bytes


class HeightWriter:
    """Writes `heights.zarr.zip`: an array `height_TARGET` a target, [frames, C, n, n] float32, in metres.

    Parameters
    ----------
    folder : path
        Of the scene.
    frames : int
        How many there will be.
    rate : float
        Frames in a second of the scene's time.
    """

    def __init__(self, folder: Path, frames: int, rate: float) -> None:
        import zarr

        self._folder, self._frames = folder / "heights.zarr", frames
        self._group = zarr.open_group(str(self._folder), mode="w", zarr_format=2)
        self._arrays: dict[str, Any] = {}
        self._create("time", np.arange(frames) / rate, (frames,), ["time"], "s")[...] = np.arange(frames) / rate

    def write(self, frame: int, heights: Mapping[str, NDArray]) -> None:
        """Add the heights of a frame, by target."""
        for name, height in heights.items():
            array = self._arrays.get(name)
            if array is None:
                suffix = re.sub(r"\W", "_", name)
                dimensions = ["time", *(f"{each}_{suffix}" for each in ("chart", "row", "column"))]
                array = self._create(f"height_{suffix}", height, (self._frames, *height.shape), dimensions, "m")
                array.attrs["target"] = name
                self._arrays[name] = array
            array[frame] = height

    def finish(self) -> None:
        """Complete the file."""
        import zarr

        zarr.consolidate_metadata(self._group.store)
        with zipfile.ZipFile(self._folder.with_name(HEIGHTS), "w") as file:
            for path in sorted(path for path in self._folder.rglob("*") if path.is_file()):
                file.writestr(zipfile.ZipInfo(path.relative_to(self._folder).as_posix(), _ALWAYS), path.read_bytes())
        shutil.rmtree(self._folder)

    def _create(self, name: str, like: NDArray, shape: tuple[int, ...], dimensions: list[str], unit: str) -> Any:
        """An array with a frame a chunk, so that memory does not grow with the scene."""
        chunks = (1, *shape[1:]) if len(shape) > 1 else shape
        array = self._group.create_array(name, shape=shape, dtype=like.dtype, chunks=chunks, fill_value=None)
        array.attrs.update({"_ARRAY_DIMENSIONS": dimensions, "units": unit})
        return array


def read_heights(content: bytes) -> dict[str, NDArray]:
    """The heights in a `heights.zarr.zip`, [frames, C, n, n] in metres, by target."""
    import zarr
    from zarr.buffer import cpu

    with zipfile.ZipFile(io.BytesIO(content)) as file:
        stored = {name: cpu.Buffer.from_bytes(file.read(name)) for name in file.namelist()}
    group = zarr.open_group(zarr.storage.MemoryStore(stored), mode="r", zarr_format=2)
    return {str(array.attrs["target"]): array[...] for name, array in group.arrays() if name != "time"}


IMPULSES, POSITIONS = "impulses.csv", "qpos.npy"


class FrameRecord:
    """Writes files into the folder of a scene, frame by frame; call it with the simulation at the time of each frame.

    Parameters
    ----------
    folder : path
        Of the scene.
    store : StoreEntry
        Which files.
    frames : int
        How many frames there will be.
    rate : float
        Frames in a second of the scene's time.
    """

    def __init__(self, folder: Path, store: StoreEntry, frames: int, rate: float) -> None:
        self._folder, self._store, self._frames = folder, store, frames
        self._heights = HeightWriter(folder, frames, rate) if store.heights else None
        self._positions: np.memmap | None = None
        self._rows: list[tuple] = []
        self._total = 0.0
        self._highest: dict[str, float] = {}
        self._energies: dict[str, list[float]] = {}
        self._digest = hashlib.blake2b(digest_size=16)
        self.frame = 0

    def __call__(self, simulation: Simulation) -> None:
        """Record a frame."""
        data, ripples = simulation.data, simulation.ripples
        if self._store.positions:
            if self._positions is None:
                shape = (self._frames, len(data.qpos))
                self._positions = open_memmap(self._folder / POSITIONS, mode="w+", dtype=np.float64, shape=shape)
            self._positions[self.frame] = data.qpos
        self._digest.update(data.qpos.tobytes() + data.qvel.tobytes())
        heights = {name: ripples[name].height for name in ripples}
        if self._heights is not None:
            self._heights.write(self.frame, heights)
        for name, height in heights.items():
            self._digest.update(height.tobytes())
            self._highest[name] = max(self._highest.get(name, 0.0), float(np.abs(height).max()))
            self._energies.setdefault(name, []).append(ripples[name].energy())
        self._total += sum(each.impulse for each in simulation.impulses)
        self._rows += rows(Moment(self.frame, data, simulation.impulses))
        self.frame += 1

    def finish(self) -> dict[str, Any]:
        """Complete the files, and return what is to be known of the scene at a glance, in SI units."""
        if self._positions is not None:
            self._positions.flush()
            self._positions = None
        if self._heights is not None:
            self._heights.finish()
        if self._store.impulses:
            with (self._folder / IMPULSES).open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(HEADER)
                writer.writerows(self._rows)
        return {
            "frames": self.frame,
            "contacts": len(self._rows),
            "impulse": self._total,
            "targets": {
                name: {
                    "height_max": self._highest[name],
                    "energy_max": max(self._energies[name]),
                    "energy_end": self._energies[name][-1],
                }
                for name in self._highest
            },
            "states": self._digest.hexdigest(),
        }
