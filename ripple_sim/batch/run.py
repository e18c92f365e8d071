"""One run of a batch: what is to be made is given out, and what comes back is noted."""

from __future__ import annotations

import contextlib
import queue
import shutil
import time
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

from .dask_executor import DaskExecutor
from .executors import LocalExecutor, first_alone
from .folder import BatchFolder, Failure
from .make_scene import Outcome, make_scene
from .packing import pack
from .plan import Plan
from .report import Index
from .run_options import Progress, RunOptions
from .stored_plan import load_plan

_PATIENCE = 1.0  # between looks at scenes that another process makes [s]
_INDEXED = 30.0  # between versions of the index while scenes are made [s]
_REST = 20.0  # or so many times as long as the last one took to write


class BatchRun:
    """The scenes that one process has made, and those that it still has to."""

    def __init__(self, batch: BatchFolder, plan: Plan, options: RunOptions) -> None:
        self.batch, self.options = batch, options
        self.index = Index(batch)
        self.failures, finished = batch.failures(), batch.finished()
        share = [number for number in range(plan.count) if in_shard(number, plan, options.shard)]
        self._share = set(share)
        aside = {number for number, failure in self.failures.items() if failure.aside}
        pending = [number for number in share if number not in finished and number not in aside]
        self.pending = deque(pending[: options.limit])
        self._tar_size = plan.store.scenes_per_tar if plan.store.format == "webdataset" else 0
        self._open = Counter(number // self._tar_size for number in pending) if self._tar_size else Counter()
        self.progress = Progress(len(share), len(finished.intersection(share)), len(aside.intersection(share)))
        self.full: str | None = None
        self._done: queue.SimpleQueue[tuple[int, Future]] = queue.SimpleQueue()
        self._running: set[int] = set()
        self._later: list[int] = []  # what other processes are at

    def work(self, executor: LocalExecutor | DaskExecutor, progress: Callable[[Progress], None] | None) -> None:
        """Have all scenes made."""
        start = indexed = time.monotonic()
        pause = _INDEXED
        if self._tar_size:  # those that were not packed before a kill
            for number in {number // self._tar_size for number in self.batch.loose() & self._share}:
                self._pack(number)
        while self.pending or self._running or self._later:
            self._submit(executor)
            with contextlib.suppress(queue.Empty):
                number, future = self._done.get(timeout=_PATIENCE)
                self._running.remove(number)
                self._take(number, _outcome(number, future))
            if not self.pending and not self._running and self._later and self.full is None:
                time.sleep(_PATIENCE)
                self.pending, self._later = deque(self._later), []
            self.progress.seconds = time.monotonic() - start
            if progress is not None:
                progress(self.progress)
            if time.monotonic() - indexed > pause:
                before = time.monotonic()
                self.index.write()
                indexed = time.monotonic()
                pause = max(_INDEXED, _REST * (indexed - before))

    def _submit(self, executor: LocalExecutor | DaskExecutor) -> None:
        """Give out scenes while there is a place for one, and room on the disk."""
        self.progress.free = shutil.disk_usage(self.batch.path).free
        if self.progress.free < self.options.keep_free and self.full is None:
            self.full = (
                f"the disk has {self.progress.free / 1e9:.1f} GB left, less than the {self.options.keep_free / 1e9:g} "
                "GB to be kept free"
            )
        if self.full is not None:
            self.pending.clear()
            self._later.clear()
        while self.pending and len(self._running) < executor.places:
            number = self.pending.popleft()
            self._running.add(number)
            future = executor.submit(work, str(self.batch.path), number)
            future.add_done_callback(lambda future, number=number: self._done.put((number, future)))  # type: ignore[misc]

    def _take(self, number: int, outcome: Outcome) -> None:
        if outcome.state == "busy":
            self._later.append(number)
        elif outcome.state == "full":
            self.full = f"the disk is full: {outcome.error}"
        elif outcome.state in ("failed", "died"):
            self._note_failure(number, outcome)
        else:
            self.progress.finished += 1
            if outcome.state == "made":
                self.progress.made += 1
                self.progress.frames += outcome.row["frames"]
                self.progress.bytes += outcome.row["bytes"]
                self.index.add(outcome.row, outcome.times)
            if self.failures.pop(number, None) is not None:
                self.batch.forget_failure(number)
            self._close(number)

    def _note_failure(self, number: int, outcome: Outcome) -> None:
        """Try a scene again after all others, or put it aside."""
        before = self.failures.get(number, Failure())
        self.progress.failures += before.attempts == 0
        died = outcome.state == "died"
        failure = Failure(before.errors + (not died), before.deaths + died, outcome.error)
        self.failures[number] = failure
        self.batch.note_failure(number, failure, outcome.log)
        if not failure.aside:
            self.pending.append(number)
        else:
            self.progress.aside += 1
            self._close(number)

    def _close(self, number: int) -> None:
        """Pack the tar file of a scene if no other scene of it is to be made."""
        if self._tar_size:
            self._open[number // self._tar_size] -= 1
            self._pack(number // self._tar_size)

    def _pack(self, group: int) -> None:
        if self._open[group] <= 0:
            pack(self.batch, group * self._tar_size, (group + 1) * self._tar_size)


def work(folder: str, number: int) -> Outcome:
    """What a worker does: make a scene.

    The first on each machine is made alone, for it compiles the kernels for all others; so is the first of each
    source, which makes the atlases.
    """
    batch = BatchFolder(Path(folder))
    sources = load_plan(batch.plan).sources
    with first_alone(batch.work, "machine"), first_alone(batch.work, f"source-{number % len(sources)}"):
        return make_scene(folder, number)


def in_shard(number: int, plan: Plan, shard: tuple[int, int]) -> bool:
    """Whether a scene belongs to a part of the batch; scenes of a tar file stay together."""
    together = plan.store.scenes_per_tar if plan.store.format == "webdataset" else 1
    return number // together % shard[1] == shard[0] - 1


def _outcome(number: int, future: Future) -> Outcome:
    try:
        return future.result()
    except Exception as error:  # the worker died
        return Outcome(number, "died", error=f"its worker died: {' '.join(str(error).split())}")
