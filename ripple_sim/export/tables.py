"""The impulses of a run as a table, or the samples of its sensors: a .csv or .parquet file."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco

from ripple_sim.coupling.ripples import Impulse
from ripple_sim.encode.replace import MARK
from ripple_sim.solver.waves.sensor import UNITS, Sensor

from .source import Source, Writer

# Columns of a table of impulses: name, unit, and type for pyarrow.
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

# Columns of a table of samples of sensors.
SIGNALS = {
    "sensor": ("", "string"),
    "point": ("", "int64"),
    "time": ("s", "float64"),
    "value": ("", "float64"),
    "unit": ("", "string"),
}

_MAX_WAITING_ROWS = 10_000  # of a .parquet file: rows that are kept in memory


def header(columns: Mapping[str, tuple[str, str]]) -> list[str]:
    """The names of columns, with their units."""
    return [f"{name} [{unit}]" if unit else name for name, (unit, _) in columns.items()]


HEADER = header(COLUMNS)


def rows(number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> Iterator[tuple]:
    """The impulses of a frame of a number, in the order of the columns."""
    for hit in impulses:
        x, y, z = map(float, hit.point)
        chart, row, column = hit.texel
        yield (
            number,
            data.time,
            hit.geom,
            hit.other,
            x,
            y,
            z,
            hit.impulse,
            chart,
            row,
            column,
            hit.inner,
        )


def samples(sensors: Mapping[str, Sensor]) -> Iterator[tuple]:
    """The samples of sensors that were not read yet, in the order of the columns of `SIGNALS`."""
    for name, sensor in sensors.items():
        times, values = sensor.read()
        for point, signal in enumerate(values.T.tolist()):
            for time, value in zip(times.tolist(), signal, strict=True):
                yield name, point, time, value, UNITS[sensor.kind]


class CsvWriter(Writer):
    """Writes impulses or samples as comma-separated values, one a row, units in the header."""

    def __init__(self, source: Source, path: Path) -> None:
        self._source = source
        self._file = path.open("w", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file)
        self._writer.writerow(header(SIGNALS if source.signals else COLUMNS))

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add the impulses of a frame, or the samples that are there."""
        self._writer.writerows(
            samples(self._source.sensors) if self._source.signals else rows(number, data, impulses)
        )

    def finish(self) -> None:
        """Complete the file."""
        self._file.close()


class ParquetWriter(Writer):
    """Writes impulses or samples as columns, units in their metadata."""

    def __init__(self, source: Source, path: Path) -> None:
        import pyarrow.parquet

        self._source = source
        fields = [
            pyarrow.field(
                name,
                getattr(pyarrow, f"{kind}_" if kind == "bool" else kind)(),
                metadata={"unit": unit},
            )
            for name, (unit, kind) in (SIGNALS if source.signals else COLUMNS).items()
        ]
        self._schema = pyarrow.schema(fields, metadata={"software": MARK})
        self._file = pyarrow.parquet.ParquetWriter(path, self._schema)
        self._rows: list[tuple] = []

    def write(self, number: int, data: mujoco.MjData, impulses: Sequence[Impulse]) -> None:
        """Add the impulses of a frame, or the samples that are there."""
        self._rows += (
            samples(self._source.sensors) if self._source.signals else rows(number, data, impulses)
        )
        if len(self._rows) >= _MAX_WAITING_ROWS:
            self._flush()

    def finish(self) -> None:
        """Complete the file."""
        self._flush()
        self._file.close()

    def _flush(self) -> None:
        import pyarrow

        columns: list[Any] = [list(column) for column in zip(*self._rows, strict=True)]
        if not columns:
            columns = [[] for _ in self._schema]
        self._file.write_table(pyarrow.table(columns, schema=self._schema))
        self._rows = []


def made_here(path: Path) -> bool:
    """Whether a file has the header, or the metadata, of a table from here."""
    if not path.is_file():
        return False
    if path.suffix.lower() == ".csv":
        with path.open("rb") as file:
            first = file.readline(1000).decode("utf-8", "replace").rstrip("\r\n")
        return first in (",".join(HEADER), ",".join(header(SIGNALS)))
    import pyarrow.parquet

    try:
        metadata = pyarrow.parquet.read_schema(path).metadata or {}
    except (pyarrow.ArrowException, OSError):
        return False
    return metadata.get(b"software") == MARK.encode()
