"""A Zarr store (version 2) whose arrays grow along their first dimension, with what xarray wants to know of them."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ripple_sim.encode.mark import MARK

CHUNK = 16  # entries that are kept in memory, and lie in one chunk
_METADATA, _CHUNK_NAME = (".zgroup", ".zattrs", ".zarray", ".zmetadata"), re.compile(r"\d+(\.\d+)*")


class Store:
    """Arrays that are fixed and arrays that grow, the latter written chunk by chunk.

    Parameters
    ----------
    path : Path
    attributes : mapping
        Of the store.
    """

    def __init__(self, path: Path, attributes: Mapping[str, Any]) -> None:
        import zarr

        self._group = zarr.open_group(str(path), mode="w", zarr_format=2)
        self._group.attrs.update({"software": MARK, **attributes})
        self._growing: dict[str, Any] = {}
        self._waiting: dict[str, list[NDArray]] = {}

    def fixed(self, name: str, dimensions: list[str], values: NDArray, unit: str = "", text: str = "") -> None:
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
        text: str,
        *,
        chunk: int = CHUNK,
        before: int = 0,
    ) -> None:
        """Begin an array of entries like one, which stands `before` times in it already; replace one of this name."""
        if name in self._group:
            del self._group[name]
        array = self._group.create_array(
            name, shape=(before, *like.shape), dtype=like.dtype, chunks=(chunk, *like.shape), fill_value=None
        )
        for first in range(0, before, chunk):
            last = min(first + chunk, before)
            array[first:last] = np.broadcast_to(like, (last - first, *like.shape))
        array.attrs.update(_attributes(dimensions, unit, text))
        self._growing[name], self._waiting[name] = array, []

    def add(self, name: str, value: ArrayLike) -> None:
        """Add an entry to an array that grows."""
        self._waiting[name].append(np.array(value))

    def flush(self) -> None:
        """Write what waits."""
        for name, array in self._growing.items():
            if values := self._waiting[name]:
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
