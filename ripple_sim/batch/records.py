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

from ripple_sim.export.fields import Store
from ripple_sim.export.tables import HEADER, rows
from ripple_sim.simulation import Simulation

from .plan import StoreEntry

# An array `height_TARGET` a target, [frames, C, n, n] float32, in metres, a frame a chunk.
HEIGHTS = "heights.zarr.zip"

_ALWAYS = (1980, 1, 1, 0, 0, 0)  # the time of every file in the zip file: the same heights, the same bytes


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

    There will be a number of `frames`, `rate` of them in a second of the scene's time.
    """

    def __init__(self, folder: Path, store: StoreEntry, frames: int, rate: float) -> None:
        self._folder, self._store, self._frames = folder, store, frames
        self._heights = Store(folder / HEIGHTS.removesuffix(".zip"), {}) if store.heights else None
        if self._heights is not None:
            self._heights.fixed("time", ["time"], np.arange(frames) / rate, "s")
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
        self._write(heights)
        for name, height in heights.items():
            self._digest.update(height.tobytes())
            self._highest[name] = max(self._highest.get(name, 0.0), float(np.abs(height).max()))
            self._energies.setdefault(name, []).append(ripples[name].energy())
        self._total += sum(each.impulse for each in simulation.impulses)
        self._rows += rows(self.frame, data, simulation.impulses)
        self.frame += 1

    def finish(self) -> dict[str, Any]:
        """Complete the files, and return what is to be known of the scene at a glance, in SI units."""
        if self._positions is not None:
            self._positions.flush()
            self._positions = None
        if self._heights is not None:
            self._heights.finish()
            self._pack(self._folder / HEIGHTS.removesuffix(".zip"))
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

    def _write(self, heights: Mapping[str, NDArray]) -> None:
        """Add the heights of a frame, by target."""
        if self._heights is None:
            return
        for name, height in heights.items():
            suffix = re.sub(r"\W", "_", name)
            if not self.frame:
                dimensions = ["time", *(f"{each}_{suffix}" for each in ("chart", "row", "column"))]
                array = self._heights.grow(f"height_{suffix}", dimensions, height, "m", chunk=1)
                array.attrs["target"] = name
            self._heights.add(f"height_{suffix}", height)
        self._heights.flush()  # so that memory does not grow with the scene

    def _pack(self, folder: Path) -> None:
        """Put a store's files into the zip file."""
        with zipfile.ZipFile(self._folder / HEIGHTS, "w") as file:
            for path in sorted(path for path in folder.rglob("*") if path.is_file()):
                file.writestr(zipfile.ZipInfo(path.relative_to(folder).as_posix(), _ALWAYS), path.read_bytes())
        shutil.rmtree(folder)
