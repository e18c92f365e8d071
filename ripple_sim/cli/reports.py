"""Commands that print a report, `bench`, `cache`, `info` and `materials`, and `batch`, which ends with one.

A batch shows how far it is by a bar on a terminal, and by a line a minute in a log.
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

# Of the wave whose speed and decay are told [m].
_WAVELENGTH = 0.05
_BETWEEN = 60.0  # lines in a log [s]


@dataclasses.dataclass(frozen=True, kw_only=True)
class BenchCommand:
    """Measure the wave solver: speed beside the bound of memory, cost of the coupling, accuracy against theory."""

    meshes: Annotated[
        Positional[tuple[Path, ...]], arg(metavar="[MESH ...]", help_behavior_hint="(optional)")
    ] = ()
    """Meshes of which to time the atlas and the wave step, in addition to the duck."""
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
    """Show where atlases are kept, and how much room they take: at most RIPPLE_SIM_CACHE_LIMIT megabytes, or 500."""

    clear: bool = False
    """Remove them."""

    def run(self) -> None:
        """Clear the cache if asked to, and print what is in it."""
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
    """Show versions, the OpenGL driver and the wave solver, and what to install if rendering is not possible."""

    json: bool = False
    """Print JSON."""

    def run(self) -> None:
        """Print the report."""
        from ripple_sim.diagnostics import as_text, collect

        info = collect()
        print(json_format.dumps(info, indent=2) if self.json else as_text(info))


@dataclasses.dataclass(frozen=True, kw_only=True)
class MaterialsCommand:
    """List the real materials by name, with speed and decay of a wave of 5 cm, sources, and where they hold."""

    json: bool = False
    """Print them as JSON."""

    def run(self) -> None:
        """Print the table."""
        from ripple_sim.solver import Material
        from ripple_sim.solver.operator.material import decay_time, phase_speed
        from ripple_sim.solver.operator.presets import PRESETS

        q = 2 * math.pi / _WAVELENGTH
        table = {}
        for name, preset in PRESETS.items():
            material = Material.preset(name)
            facts = {"speed [m/s]": phase_speed(material, q), "decay [s]": decay_time(material, q)}
            table[name] = facts | dataclasses.asdict(preset)
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
            print(
                f"{'':{width}}  source{'' if row['checked'] else ', not checked'}: {row['source']}"
            )


@dataclasses.dataclass(frozen=True, kw_only=True)
class BatchCommand:
    """Make many scenes by one plan, each varied by its own seed."""

    plan: Annotated[Positional[Path], arg(metavar="PLAN|DIR")]
    """The plan (TOML), or the folder of a batch to go on with."""
    output: Annotated[
        Path | None, arg(aliases=["-o"], metavar="DIR", help_behavior_hint="(needed with a plan)")
    ] = None
    """Folder of the batch. Run again, it makes what is not there yet."""
    workers: Limit = None
    """Processes that make scenes; by default one for every two cores, at least two."""
    shard: Shard = None
    """Make a part of the scenes only, for several machines."""
    dask: Annotated[str | None, arg(metavar="ADDRESS", help_behavior_hint="(optional)")] = None
    """Address of a Dask scheduler whose workers make the scenes (needs Dask); they share the folder."""
    limit: Limit = None
    """Make at most so many scenes in this run."""
    keep_free: Gigabytes = 1.0
    """Stop when the disk has no more room than this."""
    status: bool = False
    """Tell how far the batch is, and make nothing."""
    retry_failed: bool = False
    """Try the scenes again that were put aside."""
    dry_run: bool = False
    """Make one scene for a trial, and tell the first scenes' values, the time and the room that all will take."""

    def run(self) -> None:
        """Do what is asked for."""
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
    """Frames, rate, time left, failures, room taken and left on the disk, in a line."""
    left = progress.scenes - progress.finished - progress.aside
    parts = [f"{progress.frames} frames"]
    if progress.made and progress.seconds:
        rate = progress.made / progress.seconds
        parts += [f"{3600 * rate:.0f} scenes/h", f"{duration_text(left / rate)} left"]
    if progress.failures or progress.aside:
        parts.append(f"{progress.failures} failed, {progress.aside} put aside")
    return ", ".join(
        [*parts, f"{progress.bytes / 1e9:.2f} GB written", f"{progress.free / 1e9:.1f} GB free"]
    )


def duration_text(seconds: float) -> str:
    """A time in seconds, minutes and hours."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return (
        f"{hours} h {minutes:02d} min"
        if hours
        else f"{minutes} min {rest:02d} s"
        if minutes
        else f"{rest} s"
    )


@contextlib.contextmanager
def batch_progress() -> Iterator[Callable[[Progress], None]]:
    """Yield a function that shows a batch's progress on stderr."""
    if not sys.stderr.isatty():
        told = time.monotonic()

        def log(progress: Progress) -> None:
            nonlocal told
            if time.monotonic() - told >= _BETWEEN:
                told = time.monotonic()
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
        yield lambda now: bars.update(
            task,
            total=now.scenes,
            completed=now.finished + now.aside,
            description=progress_text(now),
        )
