"""`ripple-sim batch`."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from .arguments import Gigabytes, Limit, Shard

if TYPE_CHECKING:
    from ripple_sim.batch.plan import Plan


@dataclasses.dataclass(frozen=True, kw_only=True)
class Batch:
    """Make many scenes by one plan, each varied by its own seed."""

    plan: Annotated[Positional[Path], arg(metavar="PLAN|DIR")]
    """The plan (TOML), or the folder of a batch to go on with."""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="DIR", help_behavior_hint="(needed with a plan)")] = None
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
        from ripple_sim.batch.report import parquet

        plan, folder = self._plan_and_folder()
        parquet()  # before anything that takes time
        if self.status:
            from ripple_sim.batch.status import status_text

            print(status_text(folder))
        elif self.dry_run:
            from ripple_sim.batch.trial import trial_text

            print(trial_text(plan, folder, self.workers))
        else:
            self._make(plan, folder)

    def _plan_and_folder(self) -> tuple[Plan | None, Path]:
        from ripple_sim.errors import BatchError

        if self.plan.is_dir():
            if self.output is not None:
                raise BatchError(f"{self.plan} is the folder of a batch: leave -o out, or name a plan")
            return None, self.plan
        from ripple_sim.batch.plan import read_plan

        plan = read_plan(self.plan)
        if self.output is None and not self.dry_run:
            raise BatchError("a plan needs a folder for its scenes: add -o DIR")
        return plan, self.output or self.plan.with_suffix("")

    def _make(self, plan: Plan | None, folder: Path) -> None:
        from ripple_sim.batch.run_batch import run_batch
        from ripple_sim.batch.run_options import RunOptions
        from ripple_sim.batch.status import status_text

        from .batch_progress import batch_progress

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
