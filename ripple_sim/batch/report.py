"""The index of a batch: a Parquet table with a row a scene."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable
from typing import Any

from ripple_sim.errors import BatchError
from ripple_sim.solver.files import atomic_write

from .finished_scenes import finished_scenes
from .folder import BatchFolder
from .page import write_page

_PLAIN = ("number", "seed", "source", "frames", "fps", "contacts", "impulse", "bytes", "states", "hash")


def parquet() -> Any:
    """The library that reads and writes the index; raises `BatchError` where it is missing."""
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise BatchError(
            "batches need the package pyarrow; install it with: pip install 'ripple-sim[batch]'"
        ) from error
    return pyarrow.parquet


class Index:
    """The rows of a batch's scenes, those that are there and those that are added."""

    def __init__(self, batch: BatchFolder) -> None:
        self._batch, self._parquet = batch, parquet()
        self._rows: dict[int, dict[str, Any]] = {}

    def add(self, facts: dict[str, Any], times: dict[str, Any]) -> None:
        """Add a finished scene."""
        self._rows[facts["number"]] = row(facts, times)

    def write(self) -> None:
        """Write the table and the page, with all scenes that anybody has finished, and those put aside."""
        import pyarrow

        for scene in finished_scenes(self._batch, self._rows):
            with contextlib.suppress(FileNotFoundError):  # another process packs it, and will write the index too
                self._rows[scene.number] = row(scene.facts(), scene.times())
        failures = self._batch.failures()
        rows = [self._rows[number] for number in sorted(self._rows)]
        rows += [
            {"number": number, "status": "failed", "attempts": failure.attempts, "error": failure.error}
            for number, failure in sorted(failures.items())
            if number not in self._rows
        ]
        rows.sort(key=lambda each: each["number"])
        with atomic_write(self._batch.index) as path:
            self._parquet.write_table(pyarrow.table(_columns(rows)), path)
        write_page(self._batch, rows)


def row(facts: dict[str, Any], times: dict[str, Any]) -> dict[str, Any]:
    """What the index says of a finished scene: one value a column."""
    targets = facts["targets"].values()
    return {
        "status": "finished",
        **{name: facts[name] for name in _PLAIN},
        "seconds": times["seconds"],
        "cpu_seconds": times["cpu_seconds"],
        "height_max": max(each["height_max"] for each in targets),
        "energy_max": sum(each["energy_max"] for each in targets),
        "energy_end": sum(each["energy_end"] for each in targets),
        **facts["values"],
    }


def _columns(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
    """Lists of values by column; a column of values of several kinds holds their JSON."""
    names = dict.fromkeys(name for each in rows for name in each)
    columns = {name: [each.get(name) for each in rows] for name in ("number", *(n for n in names if n != "number"))}
    return {
        name: values if _alike(values) else [json.dumps(value) for value in values] for name, values in columns.items()
    }


def _alike(values: Iterable[Any]) -> bool:
    kinds = {float if isinstance(value, int) and not isinstance(value, bool) else type(value) for value in values}
    return len(kinds - {type(None)}) <= 1 and not kinds & {dict}
