"""Commands that print a report: `bench`, `cache`, `info`, `materials` and `batch`.

A batch shows its progress as a bar on a terminal, and as a line every minute in a log.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json as json_format
import math
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress as Bars, TextColumn
from tyro.conf import Positional, arg

from .arguments import Gigabytes, Limit, Shard

if TYPE_CHECKING:
    from ripple_sim.batch.run import Progress

# `materials` shows the speed and decay of a wave of this length [m].
_WAVELENGTH = 0.05

# Time between the lines of progress in a log [s].
_LOG_INTERVAL = 60.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class BenchCommand:
    """Measure this machine: speed of the wave solver, cost of the coupling, and accuracy."""

    meshes: Annotated[
        Positional[tuple[Path, ...]], arg(metavar="[MESH ...]", help_behavior_hint="(optional)")
    ] = ()
    """Meshes whose atlas and wave step are timed in addition to those of the duck."""
    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Measure and print; the stages are announced on stderr."""
        from ripple_sim.bench import as_text, measure

        report = measure(
            list(self.meshes), lambda stage: print(f"measuring {stage} ...", file=sys.stderr)
        )
        print(json_format.dumps(report, indent=2) if self.json else as_text(report))


@dataclasses.dataclass(frozen=True, kw_only=True)
class CacheCommand:
    """Show where atlases are kept and how much room they take, or remove them.

    The cache holds RIPPLE_SIM_CACHE_LIMIT megabytes at most, 500 by default; the least recently
    used atlas goes first.
    """

    clear: bool = False
    """Remove all atlases from the cache."""

    def run(self) -> None:
        """Clear the cache if requested, and print its size."""
        from ripple_sim.solver.cache import cache_folder, cache_limit, cached_files, removed

        limit = cache_limit()
        files = cached_files()
        if self.clear:
            freed = sum(size * removed(path) for path, size in files.items())
            print(f"removed {len(files)} files, {freed / 1e6:.0f} MB")
            files = cached_files()
        size = sum(files.values())
        print(f"{cache_folder()}: {len(files)} files, {size / 1e6:.0f} of {limit / 1e6:.0f} MB")


@dataclasses.dataclass(frozen=True, kw_only=True)
class InfoCommand:
    """Show versions, the OpenGL driver and the wave solver, and what rendering lacks."""

    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Print the report."""
        from ripple_sim.diagnostics import as_text, collect

        info = collect()
        print(json_format.dumps(info, indent=2) if self.json else as_text(info))


@dataclasses.dataclass(frozen=True, kw_only=True)
class MaterialsCommand:
    """List the presets of real materials, with the speed and decay of a 5 cm wave, and sources."""

    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Print the table."""
        from ripple_sim.solver import Material
        from ripple_sim.solver.operator.material import decay_time, phase_speed
        from ripple_sim.solver.operator.presets import PRESETS

        wave_number = 2 * math.pi / _WAVELENGTH  # [1/m]
        table = {}
        for name, preset in PRESETS.items():
            material = Material.preset(name)
            table[name] = {
                "speed [m/s]": phase_speed(material, wave_number),
                "decay [s]": decay_time(material, wave_number),
                **dataclasses.asdict(preset),
            }
        if self.json:
            print(json_format.dumps(table, indent=2))
            return
        width = max(map(len, table))
        for name, row in table.items():
            print(
                f"{name:{width}}  {row['speed [m/s]']:.3g} m/s, falls to 1/e in "
                f"{row['decay [s]']:.3g} s"
            )
            parameters = ", ".join(f"{key} {value:g}" for key, value in row["parameters"].items())
            print(f"{'':{width}}  {row['law']}: {parameters}")
            print(f"{'':{width}}  holds: {row['valid']}")
            unchecked = "" if row["checked"] else ", not checked"
            print(f"{'':{width}}  source{unchecked}: {row['source']}")


@dataclasses.dataclass(frozen=True, kw_only=True)
class BatchCommand:
    """Make many scenes from one plan, each varied by its own seed."""

    plan: Annotated[Positional[Path], arg(metavar="PLAN|DIR")]
    """The plan (TOML), or the folder of a batch to continue."""
    output: Annotated[
        Path | None, arg(aliases=["-o"], metavar="DIR", help_behavior_hint="(needed with a plan)")
    ] = None
    """Folder of the batch. The same command again makes the scenes that are missing."""
    workers: Limit = None
    """Number of processes that make scenes. By default one for every two cores, at least two."""
    shard: Shard = None
    """Make only part I of N of the scenes, to share a batch among machines."""
    dask: Annotated[str | None, arg(metavar="ADDRESS", help_behavior_hint="(optional)")] = None
    """Address of a Dask scheduler (needs Dask). Its workers make the scenes, and must see the same
    folder."""
    limit: Limit = None
    """Largest number of scenes to make in this run."""
    keep_free: Gigabytes = 1.0
    """Stop when the disk has less free room than this."""
    status: bool = False
    """Print the progress of the batch, and make nothing."""
    retry_failed: bool = False
    """Try again the scenes that were put aside after repeated failures."""
    dry_run: bool = False
    """Make one scene as a trial, and print the values of the first scenes and the time and room for
    all."""

    def run(self) -> None:
        """Make the batch, or print its status or the result of a trial."""
        from ripple_sim.batch.plan import read_plan
        from ripple_sim.batch.report import parquet, status_text
        from ripple_sim.errors import BatchError

        plan = None if self.plan.is_dir() else read_plan(self.plan)
        if plan is None and self.output is not None:
            raise BatchError(f"{self.plan} is the folder of a batch: leave -o out, or name a plan")
        if plan is not None and self.output is None and not self.dry_run:
            raise BatchError("a plan needs a folder for its scenes: add -o DIR")
        folder = self.plan if plan is None else self.output or self.plan.with_suffix("")
        parquet()  # before anything that takes time
        if self.status:
            print(status_text(folder))
        elif self.dry_run:
            from ripple_sim.batch.run import trial_text

            print(trial_text(plan, folder, self.workers))
        else:
            from ripple_sim.batch.run import RunOptions, run_batch

            options = RunOptions(
                workers=self.workers,
                shard=self.shard or (1, 1),
                limit=self.limit,
                dask=self.dask,
                retry_failed=self.retry_failed,
                keep_free=self.keep_free * 1e9,
            )
            with batch_progress() as progress:
                run_batch(plan, folder, options, progress=progress)
            print(status_text(folder))


def progress_text(progress: Progress) -> str:
    """One line: frames, rate, time left, failures, and room taken and free on the disk."""
    items = [f"{progress.frames} frames"]
    if progress.made and progress.seconds:
        rate = progress.made / progress.seconds  # [scenes/s]
        missing_scenes = progress.scenes - progress.finished - progress.aside
        items.append(f"{3600 * rate:.0f} scenes/h")
        items.append(f"{duration_text(missing_scenes / rate)} left")
    if progress.failures or progress.aside:
        items.append(f"{progress.failures} failed, {progress.aside} put aside")
    items.append(f"{progress.bytes / 1e9:.2f} GB written")
    items.append(f"{progress.free / 1e9:.1f} GB free")
    return ", ".join(items)


def duration_text(seconds: float) -> str:
    """A time [s] in words: seconds, minutes and seconds, or hours and minutes."""
    whole_minutes, rounded_seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(whole_minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    if minutes:
        return f"{minutes} min {rounded_seconds:02d} s"
    return f"{rounded_seconds} s"


@contextlib.contextmanager
def batch_progress() -> Iterator[Callable[[Progress], None]]:
    """Yield a function that shows a batch's progress on stderr."""
    if not sys.stderr.isatty():
        latest_line = time.monotonic()

        def log(progress: Progress) -> None:
            nonlocal latest_line
            if time.monotonic() - latest_line >= _LOG_INTERVAL:
                latest_line = time.monotonic()
                done = progress.finished + progress.aside
                print(
                    f"{done} of {progress.scenes} scenes, {progress_text(progress)}",
                    file=sys.stderr,
                    flush=True,
                )

        yield log
        return
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("scenes, {task.description}"))
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("", total=None)
        yield lambda progress: bars.update(
            task,
            total=progress.scenes,
            completed=progress.finished + progress.aside,
            description=progress_text(progress),
        )
