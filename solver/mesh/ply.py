"""The rows of a PLY file, element by element, text or binary."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MeshError


@dataclasses.dataclass
class Element:
    """A table of the file: so many rows of named values, of which some are lists (of a length type)."""

    name: str
    rows: int
    names: list[str] = dataclasses.field(default_factory=list)
    types: list[str] = dataclasses.field(default_factory=list)
    lengths: list[str | None] = dataclasses.field(default_factory=list)


def read_text(element: Element, data: bytes, order: str) -> tuple[dict[str, Any], bytes]:
    """Columns of an element by name, and the data after it.

    Raises
    ------
    MeshError
        If the data end early, or a row has something other than numbers.
    """
    parts = data.split(b"\n", element.rows) if element.rows <= len(data) else []
    if len(parts) < element.rows or (len(parts) == element.rows and element.rows and not parts[-1].strip()):
        raise _ends_early(element)
    rest = parts[element.rows] if len(parts) > element.rows else b""
    rows = [part.split() for part in parts[: element.rows]]
    columns: dict[str, Any] = {}
    try:
        if not any(element.lengths):
            table = np.array([row[: len(element.names)] for row in rows], dtype=np.float64)
            table = table.reshape(element.rows, len(element.names))
            return dict(zip(element.names, table.T, strict=True)), rest
        at = [0] * len(rows)
        for name, length in zip(element.names, element.lengths, strict=True):
            sizes = [1] * len(rows) if length is None else [int(row[i]) for row, i in zip(rows, at, strict=True)]
            first = [i + (length is not None) for i in at]
            at = [i + size for i, size in zip(first, sizes, strict=True)]
            if any(not i <= j <= len(row) for i, j, row in zip(first, at, rows, strict=True)):
                raise _ends_early(element)
            columns[name] = [np.array(row[i:j], dtype=np.float64) for row, i, j in zip(rows, first, at, strict=True)]
    except (ValueError, IndexError) as error:
        raise MeshError(f"a row of its element {element.name} is not understood") from error
    return columns, rest


def read_binary(element: Element, data: bytes, order: str) -> tuple[dict[str, Any], bytes]:
    """Columns of an element by name, and the data after it; `order` is "<" or ">".

    Raises
    ------
    MeshError
        If the data end early.
    """
    columns = _read_table(element, data, order)
    if columns is not None:
        return columns
    return _read_rows(element, data, order)


def _read_table(element: Element, data: bytes, order: str) -> tuple[dict[str, Any], bytes] | None:
    """Read rows that are all of one length, in one go; None where their lists are not."""
    if not element.names:
        return {}, data
    fields: list[Any] = []
    sizes: dict[str, int] = {}
    for name, kind, length in zip(element.names, element.types, element.lengths, strict=True):
        if length is None:
            fields.append((name, order + kind))
            continue
        first = np.dtype(fields).itemsize if fields else 0
        kind_of_length = np.dtype(order + length)
        if len(data) < first + kind_of_length.itemsize:
            return None
        sizes[name] = int(np.frombuffer(data, kind_of_length, 1, first)[0])
        if not 0 <= sizes[name] * np.dtype(kind).itemsize <= len(data):
            return None
        fields += [(f"{name} length", kind_of_length), (name, order + kind, (sizes[name],))]
    row = np.dtype(fields)
    if element.rows * row.itemsize > len(data):
        if sizes:
            return None
        raise _ends_early(element)
    table = np.frombuffer(data, row, element.rows)
    if any((table[f"{name} length"] != size).any() for name, size in sizes.items()):
        return None
    return {name: table[name] for name in element.names}, data[element.rows * row.itemsize :]


def _read_rows(element: Element, data: bytes, order: str) -> tuple[dict[str, Any], bytes]:
    columns: dict[str, list[NDArray]] = {name: [] for name in element.names}
    kinds = [np.dtype(order + kind) for kind in element.types]
    lengths = [None if length is None else np.dtype(order + length) for length in element.lengths]
    at = 0
    try:
        for _ in range(element.rows):
            for name, kind, length in zip(element.names, kinds, lengths, strict=True):
                size = 1
                if length is not None:
                    size = int(np.frombuffer(data, length, 1, at)[0])
                    at += length.itemsize
                if not 0 <= size <= len(data):
                    raise _ends_early(element)
                columns[name].append(np.frombuffer(data, kind, size, at))
                at += size * kind.itemsize
    except ValueError as error:  # numpy, where bytes are missing
        raise _ends_early(element) from error
    return dict(columns), data[at:]


def _ends_early(element: Element) -> MeshError:
    return MeshError(f"it ends before the {element.rows} rows of its element {element.name}")
