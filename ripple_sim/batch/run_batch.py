"""`run_batch`: makes the scenes of a plan that are not there yet, whoever works on them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

from ripple_sim.errors import BatchError

from .dask_executor import DaskExecutor
from .executors import LocalExecutor, usual_workers
from .folder import BatchFolder
from .plan import Plan
from .run import BatchRun
from .run_options import Progress, RunOptions
from .stored_plan import keep_plan, load_stored, stored
from .variation import Variation

_TRIED = 3  # scenes whose values are drawn before the batch begins


def run_batch(
    plan: Plan | None,
    output: str | Path,
    options: RunOptions = RunOptions(),  # noqa: B008 - frozen
    *,
    progress: Callable[[Progress], None] | None = None,
) -> Progress:
    """Make the scenes of a batch that are not there yet.

    It may be killed at any time and started again, also while others make scenes of the same batch.

    Parameters
    ----------
    plan : Plan or None
        From `read_plan`; None goes on with the plan in the folder.
    output : path
        Folder of the batch.
    options : RunOptions
    progress : callable, optional
        Called with the progress, about once a second.

    Raises
    ------
    RippleError
        If the plan is another than the folder's, a key of it fits nothing, or the disk is nearly full.
    """
    batch = BatchFolder(Path(output).absolute())
    if plan is None:
        batch.check()
        plan = load_stored(batch.plan).plan
    for number in range(min(len(plan.sources), plan.count, _TRIED)):
        Variation(plan, number).load()  # a key that fits nothing is told before anything is made
    keep_plan(batch, stored(plan))
    if options.retry_failed:
        for number in batch.failures():
            batch.forget_failure(number)
    run = BatchRun(batch, plan, options)
    with _executor(options, run) as executor:
        run.work(executor, progress)
    run.index.write()
    if run.full is not None:
        raise BatchError(f"{run.full}; make room, or lower --keep-free, and run the same command again to go on")
    return run.progress


@contextlib.contextmanager
def _executor(options: RunOptions, run: BatchRun) -> Iterator[LocalExecutor | DaskExecutor]:
    executor: LocalExecutor | DaskExecutor
    if options.dask is not None:
        executor = DaskExecutor(options.dask)
    else:
        executor = LocalExecutor(min(options.workers or usual_workers(), max(1, len(run.pending))))
    try:
        yield executor
    except BaseException:  # such as Ctrl-C: what is unfinished goes on next time
        executor.shutdown(wait=False, cancel_futures=True)
        raise
    executor.shutdown()
