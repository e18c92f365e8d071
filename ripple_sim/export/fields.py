"""The fields of a run over time as a Zarr store (version 2), which xarray opens as one dataset."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.encode.replace import MARK, read_object
from ripple_sim.solver.texels.moving import SurfaceRide
from ripple_sim.solver.waves.sensor import UNITS

from .source import Source, Writer
from .tables import COLUMNS, rows

CHUNK = 16  # frames that are kept in memory, and lie in one chunk of an array
_IMPULSE_CHUNK = 4096  # impulses that lie in one chunk

# Names of the files of a Zarr store.
_METADATA = (".zgroup", ".zattrs", ".zarray", ".zmetadata")
_CHUNK_NAME = re.compile(r"\d+(\.\d+)*")

# NumPy's types of the columns of impulses, by the types for pyarrow.
DTYPES = {"int64": "i8", "float64": "f8", "bool": "?", "string": "U64"}


class Store:
    """Fixed arrays, growing arrays, which are written chunk by chunk, and attributes of all."""

    def __init__(self, path: Path, attributes: Mapping[str, Any]) -> None:
        import zarr

        self._group = zarr.open_group(str(path), mode="w", zarr_format=2)
        if attributes:
            self._group.attrs.update(attributes)
        self._growing: dict[str, Any] = {}
        self._waiting: dict[str, list[NDArray]] = {}

    def fixed(
        self, name: str, dimensions: list[str], values: NDArray, unit: str = "", text: str = ""
    ) -> None:
        """Write an array as a whole; `text` says what it is."""
        array = self._group.create_array(
            name, shape=values.shape, dtype=values.dtype, chunks=values.shape, fill_value=None
        )
        array[...] = values
        array.attrs.update(_attributes(dimensions, unit, text))

    def grow(
        self,
        name: str,
        dimensions: list[str],
        like: NDArray,
        unit: str,
        text: str = "",
        *,
        chunk: int = CHUNK,
        before: int = 0,
    ) -> Any:
        """Begin an array of entries like `like`; replace an array of the same name.

        The array begins with `like` as its entries `before` times.
        """
        if name in self._group:
            del self._group[name]
        array = self._group.create_array(
            name,
            shape=(before, *like.shape),
            dtype=like.dtype,
            chunks=(chunk, *like.shape),
            fill_value=None,
        )
        for first in range(0, before, chunk):
            last = min(first + chunk, before)
            array[first:last] = np.broadcast_to(like, (last - first, *like.shape))
        array.attrs.update(_attributes(dimensions, unit, text))
        self._growing[name] = array
        self._waiting[name] = []
        return array

    def add(self, name: str, value: ArrayLike) -> None:
        """Add an entry to an array that grows."""
        self._waiting[name].append(np.array(value))

    def flush(self) -> None:
        """Write the entries that wait."""
        for name, array in self._growing.items():
            values = self._waiting[name]
            if values:
                before = array.shape[0]
                array.resize((before + len(values), *array.shape[1:]))
                array[before:] = np.stack(values)
                self._waiting[name] = []

    def finish(self) -> None:
        """Complete the store."""
        import zarr

        self.flush()
        zarr.consolidate_metadata(self._group.store)


def made_here(path: Path) -> bool:
    """Whether a folder is a store from here, with nothing else in it."""
    if read_object(path / ".zattrs").get("software") != MARK:
        return False
    return all(_belongs_to_store(file) for file in path.rglob("*"))


def _belongs_to_store(path: Path) -> bool:
    if path.is_symlink():
        return False
    is_chunk = _CHUNK_NAME.fullmatch(path.name) is not None
    return path.is_dir() or path.name in _METADATA or is_chunk


def _attributes(dimensions: list[str], unit: str, text: str) -> Mapping[str, Any]:
    attributes: dict[str, Any] = {"_ARRAY_DIMENSIONS": dimensions}
    if unit:
        attributes["units"] = unit
    if text:
        attributes["long_name"] = text
    return attributes


class FieldWriter(Writer):
    """Writes heights, velocities, energies, poses and impulses to a Zarr store.

    All arrays have units and coordinates. Variables of a target end in its name: `height_duck` has
    the dimensions time, chart_duck, row_duck and column_duck. Only on surfaces that move the places
    of texels have a time.
    """

    def __init__(self, source: Source, path: Path) -> None:
        self._source = source
        self._store = store = Store(
            path, {"software": MARK, "fps": source.fps, "slow_motion": source.slow_motion}
        )
        model = source.model
        store.fixed(
            "body",
            ["body"],
            np.array([model.body(i).name or f"body {i}" for i in range(model.nbody)]),
        )
        store.fixed("axis", ["axis"], np.array(["x", "y", "z"]))
        store.fixed("component", ["component"], np.array(["w", "x", "y", "z"]))
        store.grow("time", ["time"], np.zeros(()), "s", "time of the simulation")
        places = np.zeros((model.nbody, 3))
        turns = np.zeros((model.nbody, 4))
        store.grow(
            "position", ["time", "body", "axis"], places, "m", "position of bodies in the world"
        )
        store.grow("orientation", ["time", "body", "component"], turns, "1", "quaternion of bodies")
        self._targets = {name: _TargetFields(source, name, store) for name in source.ripples}
        for column, (unit, kind) in COLUMNS.items():
            one = np.zeros((), DTYPES[kind])
            store.grow(
                f"impulse_{column}",
                ["impulse"],
                one,
                unit,
                f"{column} of an impulse",
                chunk=_IMPULSE_CHUNK,
            )

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add a frame."""
        self._store.add("time", data.time)
        self._store.add("position", data.xpos)
        self._store.add("orientation", data.xquat)
        for name, fields in self._targets.items():
            fields.write(self._source.ripples.vertices(name, data), number)
        for row in rows(number, data, impulses):
            for column, value in zip(COLUMNS, row, strict=True):
                self._store.add(f"impulse_{column}", value)
        if number % CHUNK == CHUNK - 1:
            self._store.flush()

    def finish(self) -> None:
        """Complete the store, with the samples of sensors."""
        for name, sensor in self._source.sensors.items():
            suffix = re.sub(r"\W", "_", name)
            unit = UNITS[sensor.kind]
            time = f"time_{suffix}"
            point = f"point_{suffix}"
            self._store.fixed(
                time, [time], sensor.times, "s", f"time of the samples of sensor {name}"
            )
            self._store.fixed(
                f"sensor_{suffix}", [time, point], sensor.samples, unit, f"{sensor.kind} at {name}"
            )
        self._store.finish()


class _TargetFields:
    """The variables of a target."""

    def __init__(self, source: Source, name: str, store: Store) -> None:
        self._waves = source.ripples[name]
        self._store = store
        self._suffix = re.sub(r"\W", "_", name)
        self._dimensions = [f"{index}_{self._suffix}" for index in ("chart", "row", "column")]
        self._ride: SurfaceRide | None = None
        over_time = ["time", *self._dimensions]
        rest = self._waves.rest
        suffix = self._suffix
        for axis, name_of_axis in enumerate("xyz"):
            text = f"{name_of_axis} of texels, geom's frame"
            values = rest.positions[..., axis]
            store.fixed(f"{name_of_axis}_{suffix}", self._dimensions, values, "m", text)
        store.fixed(f"area_{suffix}", self._dimensions, rest.areas, "m^2", "area of texels at rest")
        one = np.zeros(rest.areas.shape, np.float32)
        store.grow(f"height_{suffix}", over_time, one, "m", "displacement along the outward normal")
        store.grow(f"velocity_{suffix}", over_time, one, "m/s", "rate of the height")
        store.grow(
            f"energy_{suffix}",
            ["time"],
            np.zeros(()),
            "J",
            "kinetic plus potential energy of the waves",
        )

    def write(self, V: NDArray[np.float64] | None, number: int) -> None:
        """Add the frame of a number, with the vertices of the mesh at V [m], or at rest."""
        waves = self._waves
        suffix = self._suffix
        self._store.add(f"height_{suffix}", waves.height)
        self._store.add(f"velocity_{suffix}", waves.velocity)
        self._store.add(f"energy_{suffix}", waves.energy())
        if V is not None and self._ride is None:
            self._ride = SurfaceRide(waves.rest)
            # the places get a time: at rest in the frames so far
            over_time = ["time", *self._dimensions]
            for axis, name_of_axis in enumerate("xyz"):
                name = f"{name_of_axis}_{suffix}"
                rest = waves.rest.positions[..., axis]
                text = f"{name_of_axis} of texels, geom's frame; the world's if soft"
                self._store.grow(name, over_time, rest, "m", text, before=number)
        if self._ride is not None:
            positions, _ = self._ride.positions(waves.rest.mesh.V if V is None else V)
            for axis, name_of_axis in enumerate("xyz"):
                self._store.add(f"{name_of_axis}_{suffix}", positions[..., axis])
