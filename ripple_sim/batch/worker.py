"""`make_scene`: make one scene of a batch, in a folder of its own, in any process.

A `FrameRecord` writes impulses, heights, positions and energies while the scene runs.
"""

from __future__ import annotations

import contextlib
import csv
import errno
import hashlib
import itertools
import os
import re
import shutil
import socket
import threading
import time
import traceback
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.lib.format import open_memmap
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.errors import BatchError, EncodingError
from ripple_sim.export.fields import Store
from ripple_sim.export.tables import HEADER, rows
from ripple_sim.scene.scene import Scene
from ripple_sim.simulation import Simulation
from ripple_sim.solver.files import atomic_write
from ripple_sim.solver.waves.sensor import Sensor
from ripple_sim.video.render_video import render_video
from ripple_sim.video.settings import frame_count, settled

from .finished import FACTS, HEIGHTS, IMPULSES, POSITIONS, SENSORS, TIMES, FinishedScene, facts_hash
from .folder import BatchFolder, clear, load_stored
from .plan import Plan, StoreEntry, options_of, video_name
from .variation import Variation

# Longer edge of a thumbnail [pixels].
_THUMBNAIL_SIZE = 160

# Time of every file in the zip file of heights. It is fixed, so that the same heights give the same
# bytes.
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)

# The renderer's context belongs to one scene at a time, also if an executor has threads.
_one_at_a_time = threading.Lock()


def write_thumbnail(scene: FinishedScene, frames: int, output: Path) -> None:
    """Write a small JPEG of the middle frame of a scene.

    Nothing is written if the scene has no frames, or EXR frames only.
    """
    middle = None
    with contextlib.suppress(BatchError):
        # the loop ends at the frame in the middle
        for middle in itertools.islice(scene.frames(), frames // 2 + 1):  # noqa: B007
            pass
    if middle is not None:
        image = Image.fromarray(middle)
        image.thumbnail((_THUMBNAIL_SIZE, _THUMBNAIL_SIZE))
        with atomic_write(output) as path:
            image.save(path, format="JPEG", quality=80)


class FrameRecord:
    """Records a scene into files of its folder, frame by frame.

    Call it with the simulation at the time of each frame.

    `frames` is the number of frames, and `rate` is how many are in a second of the scene [1/s].
    """

    def __init__(self, folder: Path, store: StoreEntry, frames: int, rate: float) -> None:
        self._folder = folder
        self._store = store
        self._frames = frames
        self._heights = Store(folder / HEIGHTS.removesuffix(".zip"), {}) if store.heights else None
        if self._heights is not None:
            self._heights.fixed("time", ["time"], np.arange(frames) / rate, "s")
        self._positions: np.memmap | None = None
        self._rows: list[tuple] = []  # of the table of impulses
        self._total_impulse = 0.0  # [N s]
        self._highest: dict[str, float] = {}  # by target [m]
        self._energies: dict[str, list[float]] = {}  # by target, frame by frame [J]
        self._digest = hashlib.blake2b(digest_size=16)
        self._sensors: Mapping[str, Sensor] = {}
        self.frame = 0

    def __call__(self, simulation: Simulation) -> None:
        """Record a frame."""
        data = simulation.data
        ripples = simulation.ripples
        if self._store.positions:
            if self._positions is None:
                shape = (self._frames, len(data.qpos))
                self._positions = open_memmap(
                    self._folder / POSITIONS, mode="w+", dtype=np.float64, shape=shape
                )
            self._positions[self.frame] = data.qpos
        self._digest.update(data.qpos.tobytes() + data.qvel.tobytes())
        for name in ripples:
            height = ripples[name].height
            if self._heights is not None:
                self._store_height(self._heights, name, height)
            self._digest.update(height.tobytes())
            self._highest[name] = max(self._highest.get(name, 0.0), float(np.abs(height).max()))
            self._energies.setdefault(name, []).append(ripples[name].energy())
        if self._heights is not None:
            self._heights.flush()  # so that memory does not grow with the scene
        self._sensors = simulation.sensors
        self._total_impulse += sum(impulse.impulse for impulse in simulation.impulses)
        self._rows += rows(self.frame, data, simulation.impulses)
        self.frame += 1

    def _store_height(self, store: Store, name: str, height: NDArray[np.float32]) -> None:
        """Add the height of a target at the present frame to the store."""
        suffix = re.sub(r"\W", "_", name)
        if self.frame == 0:
            dimensions = ["time", f"chart_{suffix}", f"row_{suffix}", f"column_{suffix}"]
            array = store.grow(f"height_{suffix}", dimensions, height, "m", chunk=1)
            array.attrs["target"] = name
        store.add(f"height_{suffix}", height)

    def finish(self) -> dict[str, Any]:
        """Complete the files, and return the facts of the scene, in SI units."""
        if self._positions is not None:
            self._positions.flush()
            self._positions = None
        if self._heights is not None:
            self._heights.finish()
            _zip_folder(self._folder / HEIGHTS.removesuffix(".zip"), self._folder / HEIGHTS)
        if self._sensors:
            arrays = {name: sensor.samples for name, sensor in self._sensors.items()}
            times = {f"{name} time": sensor.times for name, sensor in self._sensors.items()}
            np.savez(self._folder / SENSORS, allow_pickle=False, **arrays, **times)
        if self._store.impulses:
            with (self._folder / IMPULSES).open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(HEADER)
                writer.writerows(self._rows)
        return {
            "frames": self.frame,
            "contacts": len(self._rows),
            "impulse": self._total_impulse,
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


def _zip_folder(folder: Path, output: Path) -> None:
    """Move the files of a folder into a zip file."""
    with zipfile.ZipFile(output, "w") as archive:
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            name = path.relative_to(folder).as_posix()
            archive.writestr(zipfile.ZipInfo(name, _ZIP_TIME), path.read_bytes())
    shutil.rmtree(folder)


class Outcome(msgspec.Struct, frozen=True):
    """The outcome of a worker's scene.

    Attributes
    ----------
    state : str
        - "made": the worker has made the scene.
        - "there": another process had finished it before.
        - "busy": another process makes it.
        - "full": the disk has no room for it.
        - "failed": an error ended it.
        - "died": the worker ended without an answer.
    times : dict
        How long the scene took [s]: `seconds` by the clock, `cpu_seconds` of the worker's threads.
    row : dict
        Facts of the scene, from which its row of the index is made.
    error, log : str
        What went wrong, in a line and in full.
    """

    number: int
    state: Literal["made", "there", "busy", "full", "failed", "died"]
    times: dict[str, float] = {}
    row: dict[str, Any] = {}
    error: str = ""
    log: str = ""


def make_scene(folder: str, number: int) -> Outcome:
    """Make a scene of the batch in a folder, unless it is there or another process makes it.

    Its files do not depend on the worker or the time, byte for byte, except `times.json`, which
    names them.
    """
    batch = BatchFolder(Path(folder))
    start = time.perf_counter()
    cpu_start = time.process_time()
    with _one_at_a_time, batch.claimed(number) as place:
        if place is None:
            return Outcome(number, "there" if batch.is_finished(number) else "busy")
        try:
            facts = _make(load_stored(batch.plan).plan, number, place, batch)
            times = {
                "seconds": time.perf_counter() - start,
                "cpu_seconds": time.process_time() - cpu_start,
            }
            worker = {"host": socket.gethostname(), "process": os.getpid()}
            _write_json(place / TIMES, {**times, **worker})
        except Exception as error:  # of any kind: the batch continues without this scene
            clear(place)
            state: Literal["full", "failed"] = "full" if _is_full_disk(error) else "failed"
            message = " ".join(str(error).split()) or type(error).__name__
            return Outcome(number, state, error=message, log=traceback.format_exc())
        batch.finish(number, place)
    return Outcome(number, "made", times, facts)


def _is_full_disk(error: BaseException | None) -> bool:
    """Whether an error, or the cause of an `EncodingError`, is that the disk is full."""
    while isinstance(error, EncodingError):
        error = error.__cause__
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)


def _make(plan: Plan, number: int, folder: Path, batch: BatchFolder) -> dict[str, Any]:
    """Fill the folder of a scene; return the facts of the scene."""
    clear(folder)  # of files that a killed process left
    variation = Variation(plan, number)
    scene, values = variation.load()
    record = render_scene(scene, plan.store, folder)
    facts = {
        "number": number,
        "seed": variation.seed,
        "source": Path(variation.source).name,
        "fps": plan.store.fps,
        "values": values,
        **record.finish(),
    }
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    facts["files"] = {path.relative_to(folder).as_posix(): _digest(path) for path in files}
    facts["bytes"] = sum(path.stat().st_size for path in files)
    facts["hash"] = facts_hash(facts)
    _write_json(folder / FACTS, facts)
    write_thumbnail(FinishedScene(number, folder), record.frame, batch.thumbnail(number))
    return facts


def render_scene(scene: Scene, store: StoreEntry, folder: Path) -> FrameRecord:
    """Simulate a scene, render it if the plan stores a video, and record it."""
    name = video_name(store)
    path = folder / (name or "frames")
    options = settled(options_of(store), scene, path)
    record = FrameRecord(folder, store, frame_count(options), options.rate)
    if name is not None:
        render_video(scene, path, options, on_frame=record)
        return record
    simulation = Simulation.of(scene, options)
    for number in range(frame_count(options)):
        if number:
            simulation.advance_frame()
        record(simulation)
    return record


def _digest(path: Path) -> str:
    """Fingerprint of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()


def _write_json(path: Path, content: Any) -> None:
    path.write_bytes(msgspec.json.format(msgspec.json.encode(content), indent=1))
