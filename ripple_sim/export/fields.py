"""The fields of a run over time as a Zarr store, which xarray opens as one dataset."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.encode.mark import MARK

from .source import Moment, Source
from .tables import COLUMNS, rows

_CHUNK = 16  # frames that are kept in memory, and lie in one chunk
_IMPULSES = 4096  # in one chunk
_METADATA, _CHUNK_NAME = (".zgroup", ".zattrs", ".zarray", ".zmetadata"), re.compile(r"\d+(\.\d+)*")


class FieldWriter:
    """Writes heights, velocities, energies, poses and impulses to a Zarr store (version 2), with units and coordinates.

    Variables of a target end in its name: `height_duck` has the dimensions time, chart_duck, row_duck and column_duck.

    Parameters
    ----------
    source : Source
    path : Path
    """

    def __init__(self, source: Source, path: Path) -> None:
        import zarr

        self._source, self._names = source, {name: _identifier(name) for name in source.ripples}
        self._group = zarr.open_group(str(path), mode="w", zarr_format=2)
        self._group.attrs.update({"software": MARK, "fps": source.fps, "slow_motion": source.slow_motion})
        self._growing: dict[str, Any] = {}
        self._waiting: dict[str, list[NDArray]] = {}
        model = source.model
        bodies = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, i) or f"body {i}" for i in range(model.nbody)]
        self._fixed("body", ["body"], np.array(bodies))
        self._fixed("axis", ["axis"], np.array(["x", "y", "z"]))
        self._fixed("component", ["component"], np.array(["w", "x", "y", "z"]))
        self._grow("time", ["time"], (), np.float64, "s", "time of the simulation")
        shape = (model.nbody,)
        self._grow(
            "position", ["time", "body", "axis"], (*shape, 3), np.float64, "m", "position of bodies in the world"
        )
        self._grow("orientation", ["time", "body", "component"], (*shape, 4), np.float64, "1", "quaternion of bodies")
        for name in source.ripples:
            self._define_target(name)
        for column, (unit, kind) in COLUMNS.items():
            dtype = {"int64": np.int64, "float64": np.float64, "bool": np.bool_, "string": "<U64"}[kind]
            self._grow(f"impulse_{column}", ["impulse"], (), dtype, unit, f"{column} of an impulse", _IMPULSES)

    def write(self, moment: Moment) -> None:
        """Add a frame."""
        data = moment.data
        self._add("time", data.time)
        self._add("position", data.xpos)
        self._add("orientation", data.xquat)
        for name, suffix in self._names.items():
            waves = self._source.ripples[name]
            self._add(f"height_{suffix}", waves.height)
            self._add(f"velocity_{suffix}", waves.velocity)
            self._add(f"energy_{suffix}", waves.energy())
        for row in rows(moment):
            for column, value in zip(COLUMNS, row, strict=True):
                self._add(f"impulse_{column}", value)
        if moment.number % _CHUNK == _CHUNK - 1:
            self._flush()

    def finish(self) -> None:
        """Complete the store."""
        import zarr

        self._flush()
        zarr.consolidate_metadata(self._group.store)

    def close(self) -> None:
        """Do nothing: no file is open."""

    def _define_target(self, name: str) -> None:
        suffix, atlas = self._names[name], self._source.ripples[name].atlas
        dimensions = [f"{each}_{suffix}" for each in ("chart", "row", "column")]
        for axis, each in enumerate("xyz"):
            self._fixed(
                f"{each}_{suffix}", dimensions, atlas.positions[..., axis], "m", f"{each} of texels, geom's frame"
            )
        self._fixed(f"area_{suffix}", dimensions, atlas.areas, "m^2", "area of texels")
        over_time, shape = ["time", *dimensions], atlas.areas.shape
        self._grow(f"height_{suffix}", over_time, shape, np.float32, "m", "displacement along the outward normal")
        self._grow(f"velocity_{suffix}", over_time, shape, np.float32, "m/s", "rate of the height")
        self._grow(f"energy_{suffix}", ["time"], (), np.float64, "J", "kinetic plus potential energy of the waves")

    def _fixed(self, name: str, dimensions: list[str], values: NDArray, unit: str = "", text: str = "") -> None:
        array = self._group.create_array(
            name, shape=values.shape, dtype=values.dtype, chunks=values.shape, fill_value=None
        )
        array[...] = values
        array.attrs.update(_attributes(dimensions, unit, text))

    def _grow(
        self,
        name: str,
        dimensions: list[str],
        shape: tuple[int, ...],
        dtype: Any,
        unit: str,
        text: str,
        chunk: int = _CHUNK,
    ) -> None:
        array = self._group.create_array(name, shape=(0, *shape), dtype=dtype, chunks=(chunk, *shape), fill_value=None)
        array.attrs.update(_attributes(dimensions, unit, text))
        self._growing[name], self._waiting[name] = array, []

    def _add(self, name: str, value: ArrayLike) -> None:
        self._waiting[name].append(np.array(value))

    def _flush(self) -> None:
        for name, array in self._growing.items():
            if values := self._waiting[name]:
                before = array.shape[0]
                array.resize((before + len(values), *array.shape[1:]))
                array[before:] = np.stack(values)
                self._waiting[name] = []


def writer(source: Source, path: Path) -> FieldWriter:
    """Begin a store."""
    return FieldWriter(source, path)


def made_here(path: Path) -> bool:
    """Whether a folder is a store from here, with nothing else in it."""
    try:
        marked = json.loads((path / ".zattrs").read_text()).get("software") == MARK
    except (OSError, ValueError, AttributeError):
        return False
    return marked and all(
        not each.is_symlink() and (each.is_dir() or each.name in _METADATA or _CHUNK_NAME.fullmatch(each.name))
        for each in path.rglob("*")
    )


def _attributes(dimensions: list[str], unit: str, text: str) -> Mapping[str, Any]:
    attributes: dict[str, Any] = {"_ARRAY_DIMENSIONS": dimensions}
    return {**attributes, **({"units": unit} if unit else {}), **({"long_name": text} if text else {})}


def _identifier(name: str) -> str:
    return re.sub(r"\W", "_", name)
