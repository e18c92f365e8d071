"""The impulses of a run as a table: a .csv or .parquet file."""

from __future__ import annotations

import contextlib
import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import mujoco

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.encode.replace import MARK

from .source import Source

# Name and unit of every column, and its type for pyarrow.
COLUMNS = {
    "frame": ("", "int64"),
    "time": ("s", "float64"),
    "geom": ("", "string"),
    "other": ("", "string"),
    "x": ("m", "float64"),
    "y": ("m", "float64"),
    "z": ("m", "float64"),
    "impulse": ("N s", "float64"),
    "chart": ("", "int64"),
    "row": ("", "int64"),
    "column": ("", "int64"),
    "inner": ("", "bool"),
}
HEADER = [f"{name} [{unit}]" if unit else name for name, (unit, _) in COLUMNS.items()]
_GROUP = 10_000  # rows that are kept in memory


def rows(number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> Iterator[tuple]:
    """The impulses of a frame of a number, in the order of the columns."""
    for each in impulses:
        point = (float(x) for x in each.point)
        yield (number, data.time, each.geom, each.other, *point, each.impulse, *each.texel, each.inner)


class CsvWriter:
    """Writes impulses as comma-separated values, one row an impulse, units in the header."""

    def __init__(self, source: Source, path: Path) -> None:
        self._file = path.open("w", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file)
        self._writer.writerow(HEADER)

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add the impulses of a frame."""
        self._writer.writerows(rows(number, data, impulses))

    def finish(self) -> None:
        """Complete the file."""
        self._file.close()

    def close(self) -> str:
        """Leave the file incomplete."""
        with contextlib.suppress(OSError):
            self._file.close()
        return ""


class ParquetWriter:
    """Writes impulses as columns, units in their metadata."""

    def __init__(self, source: Source, path: Path) -> None:
        import pyarrow
        import pyarrow.parquet

        fields = [
            pyarrow.field(name, getattr(pyarrow, f"{kind}_" if kind == "bool" else kind)(), metadata={"unit": unit})
            for name, (unit, kind) in COLUMNS.items()
        ]
        self._schema = pyarrow.schema(fields, metadata={"software": MARK})
        self._writer = pyarrow.parquet.ParquetWriter(path, self._schema)
        self._rows: list[tuple] = []

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add the impulses of a frame."""
        self._rows += rows(number, data, impulses)
        if len(self._rows) >= _GROUP:
            self._flush()

    def finish(self) -> None:
        """Complete the file."""
        self._flush()
        self._writer.close()

    def close(self) -> str:
        """Leave the file incomplete."""
        with contextlib.suppress(OSError):
            self._writer.close()
        return ""

    def _flush(self) -> None:
        import pyarrow

        columns: list[Any] = [list(column) for column in zip(*self._rows, strict=True)] or [[] for _ in COLUMNS]
        self._writer.write_table(pyarrow.table(columns, schema=self._schema))
        self._rows = []


def made_here(path: Path) -> bool:
    """Whether a file has the header, or the metadata, of a table from here."""
    if not path.is_file():
        return False
    if path.suffix.lower() == ".csv":
        with path.open("rb") as file:
            return file.readline(1000).decode("utf-8", "replace").rstrip("\r\n") == ",".join(HEADER)
    import pyarrow
    import pyarrow.parquet

    try:
        metadata = pyarrow.parquet.read_schema(path).metadata or {}
    except (pyarrow.ArrowException, OSError):
        return False
    return metadata.get(b"software") == MARK.encode()
