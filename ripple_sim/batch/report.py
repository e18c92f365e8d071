"""Reports of a batch: the index (a Parquet table, a row a scene), a page, and the status.

`load_batch` reads its finished scenes, one after another or by number.
"""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ripple_sim.errors import BatchError
from ripple_sim.solver.errors import PATH, checked
from ripple_sim.solver.files import atomic_write

from .finished import finished_scenes
from .folder import BatchFolder, Failure, load_stored

# Largest number of scenes that the page shows.
_MAX_SHOWN_SCENES = 5_000

# Beginning of the page.
_HEAD = """<!doctype html><meta charset="utf-8"><title>{name}</title><style>
body{{font:15px system-ui,sans-serif;margin:2rem;color:#222;background:#fafafa}}
main{{display:grid;grid-template-columns:repeat(auto-fill,minmax(170px,1fr));gap:12px}}
a{{display:block;background:#fff;border-radius:6px;padding:5px;color:inherit;text-decoration:none;
font-size:12px;box-shadow:0 1px 3px #0003}}
img{{width:100%;display:block;border-radius:3px}}.failed{{background:#fdd}}
</style><h1>{name}</h1><p>{summary}</p><main>
"""

# Facts of a scene that are columns of the index.
_FACT_COLUMNS = (
    "number",
    "seed",
    "source",
    "frames",
    "fps",
    "contacts",
    "impulse",
    "bytes",
    "states",
    "hash",
)

# Largest number of failures that the status lists.
_MAX_LISTED_FAILURES = 5


def write_page(batch: BatchFolder, rows: list[dict[str, Any]]) -> None:
    """Write `index.html`: a thumbnail for each scene, the values drawn for it, and the totals."""
    finished = [row for row in rows if row["status"] == "finished"]
    frames = sum(row["frames"] for row in finished)
    size = sum(row["bytes"] for row in finished)
    seconds = sum(row["seconds"] for row in finished)
    limit = f"; the first {_MAX_SHOWN_SCENES} are shown" if len(rows) > _MAX_SHOWN_SCENES else ""
    summary = (
        f"{len(finished)} scenes, {frames} frames, {size / 1e6:.1f} MB, {seconds:.0f} s of work; "
        f"{len(rows) - len(finished)} failed{limit}"
    )
    cards = "".join(_card(batch, row) for row in rows[:_MAX_SHOWN_SCENES])
    name = html.escape(batch.path.name)
    with atomic_write(batch.page) as path:
        path.write_text(
            _HEAD.format(name=name, summary=summary) + cards + "</main>\n", encoding="utf-8"
        )


def _card(batch: BatchFolder, row: dict[str, Any]) -> str:
    """The part of the page that shows one scene."""
    number = row["number"]
    if row["status"] != "finished":
        return (
            f'<a class="failed" href="failed/{number:06d}.log">{number}: '
            f"{html.escape(str(row['error']))}</a>\n"
        )
    title = html.escape("\n".join(f"{name}: {value}" for name, value in row.items()), quote=True)
    thumbnail = batch.thumbnail(number)
    image = ""
    if thumbnail.exists():
        image = f'<img loading="lazy" src="thumbnails/{thumbnail.name}" alt="">'
    link = f"scenes/{number:06d}/" if batch.scene(number).exists() else "tars/"
    text = f"{number}: {html.escape(row['source'])}, {row['impulse']:.3g} N s"
    return f'<a href="{link}" title="{title}">{image}{text}</a>\n'


def parquet() -> Any:
    """The library that reads and writes the index; raises `BatchError` where it is missing."""
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise BatchError(
            "batches need the package pyarrow; install it with: pip install 'ripple-sim[batch]'"
        ) from error
    return pyarrow.parquet


def write_index(batch: BatchFolder, rows: dict[int, dict[str, Any]]) -> None:
    """Write the table and the page of all scenes that are finished or put aside.

    `rows` has records by scene number, see `row`; finished scenes that it lacks are added.
    """
    import pyarrow

    damaged: dict[int, Failure] = {}
    for scene in finished_scenes(batch, rows):
        try:
            rows[scene.number] = row(scene.facts(), scene.times())
        # or another process packs the scene now, and will write the index too
        except BatchError as error:
            damaged[scene.number] = Failure(error=str(error))
    failed: dict[int, dict[str, Any]] = {}
    for number, failure in (batch.failures() | damaged).items():
        failed[number] = {
            "number": number,
            "status": "failed",
            "attempts": failure.attempts,
            "error": failure.error,
        }
    records = [record for _, record in sorted((failed | rows).items())]
    names = {"number": None}
    for record in records:
        names |= dict.fromkeys(record)
    columns = {}
    for name in names:
        columns[name] = [record.get(name) for record in records]
    for name, values in columns.items():
        kinds = {_kind(value) for value in values}
        # values of several kinds are kept as JSON
        if len(kinds - {type(None)}) > 1 or dict in kinds:
            columns[name] = [json.dumps(value) for value in values]
    with atomic_write(batch.index) as path:
        parquet().write_table(pyarrow.table(columns), path)
    write_page(batch, records)


def _kind(value: Any) -> type:
    """Type of a value in a column, where whole numbers count as floats."""
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    return float if is_whole else type(value)


def row(facts: dict[str, Any], times: dict[str, Any]) -> dict[str, Any]:
    """The row of a finished scene in the index: one value a column."""
    targets = facts["targets"].values()
    return {
        "status": "finished",
        **{name: facts[name] for name in _FACT_COLUMNS},
        "seconds": times["seconds"],
        "cpu_seconds": times["cpu_seconds"],
        "height_max": max(target["height_max"] for target in targets),
        "energy_max": sum(target["energy_max"] for target in targets),
        "energy_end": sum(target["energy_end"] for target in targets),
        **facts["values"],
    }


class Batch(Sequence):
    """The scenes of a batch that were finished when it was loaded, in the order of their numbers.

    It may be sent to other processes, such as a loader's workers; files are read when they are
    asked for.

    Attributes
    ----------
    path : Path
    numbers : list of int
        Of the scenes; one that failed is not among them.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._scenes = sorted(finished_scenes(BatchFolder(path)), key=lambda scene: scene.number)
        self.numbers = [scene.number for scene in self._scenes]

    def __len__(self) -> int:
        return len(self._scenes)

    def __getitem__(self, place: Any) -> Any:
        """The scene at an index among the finished scenes.

        Its number differs from the index if scenes before it are missing.
        """
        return self._scenes[place]

    def table(self) -> Any:
        """The Parquet index as a pyarrow table.

        If pandas is installed, the table's `to_pandas` makes a data frame.
        """
        return parquet().read_table(BatchFolder(self.path).index)


@checked(BatchError, path=PATH)
def load_batch(path: str | Path) -> Batch:
    """Load a batch from its folder, also while others still make scenes of it.

    Raises
    ------
    BatchError
        If there is no batch in the folder.
    """
    path = Path(path).absolute()
    BatchFolder(path).check()
    return Batch(path)


def status_text(path: Path) -> str:
    """Status of a batch: finished scenes, failed scenes with reasons, and scenes to make.

    Raises `BatchError` if there is no batch in the folder.
    """
    batch = BatchFolder(path)
    batch.check()
    count = load_stored(batch.plan).plan.count
    finished = {number for number in batch.finished() if number < count}
    failures = {}
    for number, failure in sorted(batch.failures().items()):
        if number not in finished:
            failures[number] = failure
    aside = [number for number, failure in failures.items() if failure.aside]
    lines = [
        f"{path}: {len(finished)} of {count} scenes finished, {len(aside)} put aside, "
        f"{count - len(finished) - len(aside)} to be made"
    ]
    for number, failure in list(failures.items())[:_MAX_LISTED_FAILURES]:
        lines.append(
            f"scene {number} failed {failure.attempts} times: {failure.error} "
            f"({batch.failed.name}/{number:06d}.log)"
        )
    if len(failures) > _MAX_LISTED_FAILURES:
        lines.append(f"and {len(failures) - _MAX_LISTED_FAILURES} more failed")
    if aside:
        lines.append(f"`ripple-sim batch {path} --retry-failed` tries them again")
    return "\n".join(lines)
