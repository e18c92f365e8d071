"""What is recorded of a running scene beside its frames: impulses, heights, positions, energies."""

from __future__ import annotations

import csv
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap

from ripple_sim.export.source import Moment
from ripple_sim.export.tables import HEADER, rows
from ripple_sim.simulation import Simulation

from .height_store import HeightWriter
from .store_entry import StoreEntry

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
