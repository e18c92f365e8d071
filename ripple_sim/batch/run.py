"""`run_batch`: makes the missing scenes of a plan, in processes here or on other machines.

A `BatchRun` submits scenes to an executor, and records their outcomes. A trial makes one scene, and
estimates the time and the room for all.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import queue
import shutil
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from ripple_sim.errors import BatchError
from ripple_sim.solver.compile_clock import compile_times
from ripple_sim.solver.files import OF_THE_DISK

from .executors import DaskExecutor, LocalExecutor, first_alone, usual_workers
from .finished import pack
from .folder import BatchFolder, Failure, keep_plan, load_stored, stored
from .plan import Plan
from .report import parquet, row, write_index
from .variation import Variation
from .worker import Outcome, make_scene

# Time between two checks of scenes that other processes make [s].
_POLL_INTERVAL = 1.0

# Least time between two versions of the index while scenes are made [s].
_INDEX_INTERVAL = 30.0

# Least time between two versions of the index, over the time to write one.
_INDEX_REST = 20.0

# Number of scenes whose values are drawn, as a check, before the batch begins.
_CHECKED_SCENES = 3

# Number of scenes whose values a trial prints.
_SHOWN_SCENES = 3


@dataclasses.dataclass(frozen=True, kw_only=True)
class RunOptions:
    """How a batch is run; none of it changes a byte of the scenes."""

    workers: int | None = None
    """Processes of this machine; by default one for every two cores, at least two where there are
    two."""
    shard: tuple[int, int] = (1, 1)
    """Which part of the scenes to make, of how many."""
    limit: int | None = None
    """Greatest number of scenes in this run."""
    dask: str | None = None
    """Address of a Dask scheduler whose workers make the scenes."""
    retry_failed: bool = False
    """Try the scenes again that were put aside."""
    keep_free: float = 1e9
    """Stop when the disk has no more room than this [bytes]."""


@dataclasses.dataclass
class Progress:
    """The progress of a batch.

    Attributes
    ----------
    scenes, finished, aside : int
        Number of all scenes in this run's share, of its finished scenes, and of those that have
        been put aside.
    made, frames, bytes, failures : int
        Number of scenes that this run has made, of their frames and their bytes on the disk, and of
        scenes that have failed once or more.
    seconds : float
        Time that this run has taken so far [s].
    free : int
        Room left on the disk [bytes].
    """

    scenes: int
    finished: int
    aside: int
    made: int = 0
    frames: int = 0
    bytes: int = 0
    failures: int = 0
    seconds: float = 0.0
    free: int = 0


class BatchRun:
    """One process's run of a batch: the scenes that it still has to submit, and the outcomes."""

    def __init__(self, batch: BatchFolder, plan: Plan, options: RunOptions) -> None:
        self.batch = batch
        self.options = options
        self.rows: dict[int, dict[str, Any]] = {}  # of the index, by scene
        self.failures = batch.failures()
        finished = batch.finished()
        share = [number for number in range(plan.count) if in_shard(number, plan, options.shard)]
        self._share = set(share)
        aside = {number for number, failure in self.failures.items() if failure.aside}
        pending = [number for number in share if number not in finished and number not in aside]
        self.pending = deque(pending[: options.limit])
        self._tar_size = plan.store.scenes_per_tar if plan.store.format == "webdataset" else 0
        # missing scenes of each tar file, by the number of the tar file
        self._missing: Counter[int] = Counter()
        if self._tar_size:
            self._missing.update(number // self._tar_size for number in pending)
        self.progress = Progress(
            scenes=len(share),
            finished=len(finished.intersection(share)),
            aside=len(aside.intersection(share)),
        )
        self.full: str | None = None  # why the run ends early: the disk is full
        self._done: queue.SimpleQueue[tuple[int, Future]] = queue.SimpleQueue()
        self._running: set[int] = set()
        self._busy: list[int] = []  # scenes that other processes make

    def work(
        self, executor: LocalExecutor | DaskExecutor, progress: Callable[[Progress], None] | None
    ) -> None:
        """Have all scenes made."""
        start = time.monotonic()
        next_index = start + _INDEX_INTERVAL
        if self._tar_size:  # scenes that were not packed before a kill
            loose = self.batch.loose() & self._share
            for group in {number // self._tar_size for number in loose}:
                self._pack(group)
        while self.pending or self._running or self._busy:
            self._submit(executor)
            with contextlib.suppress(queue.Empty):
                number, future = self._done.get(timeout=_POLL_INTERVAL)
                self._running.remove(number)
                self._record(number, _outcome(number, future))
            if not self.pending and not self._running and self._busy and self.full is None:
                time.sleep(_POLL_INTERVAL)
                self.pending = deque(self._busy)
                self._busy = []
            self.progress.seconds = time.monotonic() - start
            if progress is not None:
                progress(self.progress)
            if time.monotonic() > next_index:
                index_start = time.monotonic()
                write_index(self.batch, self.rows)
                index_end = time.monotonic()
                pause = max(_INDEX_INTERVAL, _INDEX_REST * (index_end - index_start))
                next_index = index_end + pause

    def _submit(self, executor: LocalExecutor | DaskExecutor) -> None:
        """Submit scenes while the executor has places, and the disk has room."""
        self.progress.free = shutil.disk_usage(self.batch.path).free
        if self.progress.free < self.options.keep_free and self.full is None:
            self.full = (
                f"the disk has {self.progress.free / 1e9:.1f} GB left, less than the "
                f"{self.options.keep_free / 1e9:g} GB to be kept free"
            )
        if self.full is not None:
            self.pending.clear()
            self._busy.clear()
        while self.pending and len(self._running) < executor.places:
            number = self.pending.popleft()
            self._running.add(number)
            future = executor.submit(work, str(self.batch.path), number)
            future.add_done_callback(
                lambda future, number=number: self._done.put((number, future))  # type: ignore[misc]
            )

    def _record(self, number: int, outcome: Outcome) -> None:
        """Record the outcome of a scene."""
        if outcome.state == "busy":
            self._busy.append(number)
        elif outcome.state == "full":
            self.full = f"the disk is full: {outcome.error}"
        elif outcome.state in ("failed", "died"):
            self._record_failure(number, outcome)
        else:
            self._record_finished(number, outcome)

    def _record_failure(self, number: int, outcome: Outcome) -> None:
        """Note the failure of a scene; try the scene again, or put it aside."""
        earlier = self.failures.get(number, Failure())
        died = outcome.state == "died"
        failure = Failure(
            errors=earlier.errors + (not died),
            deaths=earlier.deaths + died,
            error=outcome.error,
        )
        self.progress.failures += earlier.attempts == 0
        self.failures[number] = failure
        self.batch.note_failure(number, failure, outcome.log)
        if failure.aside:
            self.progress.aside += 1
            self._close(number)
        else:
            self.pending.append(number)  # again, after all others

    def _record_finished(self, number: int, outcome: Outcome) -> None:
        """Count a scene that is finished, made by this run or by another process."""
        self.progress.finished += 1
        if outcome.state == "made":
            self.progress.made += 1
            self.progress.frames += outcome.row["frames"]
            self.progress.bytes += outcome.row["bytes"]
            self.rows[number] = row(outcome.row, outcome.times)
        if self.failures.pop(number, None) is not None:
            self.batch.forget_failure(number)
        self._close(number)

    def _close(self, number: int) -> None:
        """Pack the tar file of a scene if no other scene of it is missing."""
        if self._tar_size:
            self._missing[number // self._tar_size] -= 1
            self._pack(number // self._tar_size)

    def _pack(self, group: int) -> None:
        """Pack a tar file, by its number, if none of its scenes is missing."""
        if self._missing[group] <= 0:
            pack(self.batch, group * self._tar_size, (group + 1) * self._tar_size)


def _outcome(number: int, future: Future) -> Outcome:
    """The outcome of a scene, also if its worker died."""
    try:
        return future.result()
    except Exception as error:
        message = " ".join(str(error).split())
        return Outcome(number, "died", error=f"its worker died: {message}")


def work(folder: str, number: int) -> Outcome:
    """Make one scene, in a worker.

    The first scene on each machine is made alone, since it compiles the kernels for all others. So
    is the first scene of each source, which makes the atlases.
    """
    batch = BatchFolder(Path(folder))
    sources = load_stored(batch.plan).plan.sources
    with (
        first_alone(batch.work, "machine"),
        first_alone(batch.work, f"source-{number % len(sources)}"),
    ):
        return make_scene(folder, number)


def in_shard(number: int, plan: Plan, shard: tuple[int, int]) -> bool:
    """Whether a scene belongs to a part of the batch; scenes of a tar file stay together."""
    group_size = plan.store.scenes_per_tar if plan.store.format == "webdataset" else 1
    part, parts = shard
    return number // group_size % parts == part - 1


def run_batch(
    plan: Plan | None,
    output: str | Path,
    options: RunOptions = RunOptions(),
    *,
    progress: Callable[[Progress], None] | None = None,
) -> Progress:
    """Make the missing scenes of a batch.

    A run may be killed at any time and started again, also while other processes make scenes of the
    same batch.

    Parameters
    ----------
    plan : Plan or None
        From `read_plan`; None continues with the plan in the folder.
    output : path
        Folder of the batch.
    options : RunOptions
    progress : callable, optional
        Called with the progress, about once a second.

    Raises
    ------
    RippleError
        If the plan is another than the folder's, a key of it fits nothing, or the disk is nearly
        full.
    """
    batch = BatchFolder(Path(output).absolute())
    if plan is None:
        batch.check()
        plan = load_stored(batch.plan).plan
    for number in range(min(len(plan.sources), plan.count, _CHECKED_SCENES)):
        Variation(plan, number).load()  # refuses a key that fits nothing before any scene is made
    try:
        keep_plan(batch, stored(plan))
        if options.retry_failed:
            for number in batch.failures():
                batch.forget_failure(number)
        parquet()  # before anything that takes time
        run = BatchRun(batch, plan, options)
        executor: LocalExecutor | DaskExecutor
        if options.dask is not None:
            executor = DaskExecutor(options.dask)
        else:
            executor = LocalExecutor(
                min(options.workers or usual_workers(), max(1, len(run.pending)))
            )
        try:
            run.work(executor, progress)
        except BaseException as error:  # such as Ctrl-C: unfinished scenes are made next time
            refusal = None
            if isinstance(executor, DaskExecutor) and isinstance(error, Exception):
                refusal = executor.refusal()
            executor.shutdown(wait=False, cancel_futures=True)
            if refusal is not None:
                raise refusal from ConnectionError(str(error))
            raise
        executor.shutdown()
        write_index(batch, run.rows)
        full = run.full
    except OSError as error:
        if error.errno not in OF_THE_DISK:
            raise
        full = f"the disk is full: {error.strerror}"
    if full is not None:
        advice = "make room, or lower --keep-free, and run the same command again to go on"
        raise BatchError(f"{full}; {advice}") from OSError(errno.ENOSPC, full)
    return run.progress


def trial_text(plan: Plan | None, folder: Path, workers: int | None) -> str:
    """Make one scene in a temporary folder, and estimate what the whole batch takes.

    The text lists the values of the first scenes, and the time and room for all.

    Raises `RippleError` if the plan or one of the first scenes is invalid.
    """
    if plan is None:
        plan = load_stored(BatchFolder(folder).plan).plan
    lines = []
    for number in range(min(_SHOWN_SCENES, plan.count)):
        variation = Variation(plan, number)
        _, values = variation.load()
        text = ", ".join(f"{key} = {value}" for key, value in values.items()) or "nothing varies"
        lines.append(
            f"scene {number} ({Path(variation.source).name}, seed {variation.seed}): {text}"
        )
    with tempfile.TemporaryDirectory(prefix="ripple-sim-trial-") as name:
        batch = BatchFolder(Path(name))
        keep_plan(batch, stored(plan))
        start = time.perf_counter()
        compiled_before = sum(compile_times().values())
        outcome = make_scene(name, 0)
        if outcome.state != "made":
            raise BatchError(f"scene 0 cannot be made: {outcome.error}")
        compiling = sum(compile_times().values()) - compiled_before  # [s]
        seconds = time.perf_counter() - start - compiling
        size = sum(path.stat().st_size for path in batch.scene(0).rglob("*") if path.is_file())
    worker_count = workers or usual_workers()
    hours = plan.count * seconds / 3600
    candidates = (folder, *folder.absolute().parents)
    existing_folder = next(candidate for candidate in candidates if candidate.exists())
    free = shutil.disk_usage(existing_folder).free
    lines.append(
        f"{plan.count} scenes of {outcome.row['frames']} frames: {seconds:.1f} s and "
        f"{size / 1e6:.2f} MB for one, so about {hours:.2g} h of work (here by {worker_count} "
        f"workers, at best {hours / worker_count:.2g} h) and {plan.count * size / 1e9:.2g} GB; "
        f"{free / 1e9:.1f} GB are free"
    )
    return "\n".join(lines)
