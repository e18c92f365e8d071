"""A batch tried before it is made: the first scenes' values, and what one scene takes."""

from __future__ import annotations

import shutil
import tempfile
import time
from pathlib import Path

from ripple_sim.errors import BatchError
from ripple_sim.solver.kernel import compile_times

from .executors import usual_workers
from .folder import BatchFolder
from .make_scene import make_scene
from .plan import Plan
from .stored_plan import keep_plan, load_stored, stored
from .variation import Variation

_SHOWN = 3  # scenes whose values are told


def trial_text(plan: Plan | None, folder: Path, workers: int | None) -> str:
    """Make one scene in a temporary folder; tell the first ones' values, and the time and room that all will take.

    Raises
    ------
    RippleError
        If the plan or one of the first scenes is invalid.
    """
    if plan is None:
        plan = load_stored(BatchFolder(folder).plan).plan
    lines = []
    for number in range(min(_SHOWN, plan.count)):
        variation = Variation(plan, number)
        values = ", ".join(f"{key} = {value}" for key, value in variation.load().values.items()) or "nothing varies"
        lines.append(f"scene {number} ({Path(variation.source).name}, seed {variation.seed}): {values}")
    with tempfile.TemporaryDirectory(prefix="ripple-sim-trial-") as name:
        batch = BatchFolder(Path(name))
        keep_plan(batch, stored(plan))
        start, compiled = time.perf_counter(), sum(compile_times().values())
        outcome = make_scene(name, 0)
        if outcome.state != "made":
            raise BatchError(f"scene 0 cannot be made: {outcome.error}")
        seconds = time.perf_counter() - start - (sum(compile_times().values()) - compiled)
        size = sum(path.stat().st_size for path in batch.scene(0).rglob("*") if path.is_file())
    count = workers or usual_workers()
    while not folder.exists():
        folder = folder.absolute().parent
    lines.append(
        f"{plan.count} scenes of {outcome.row['frames']} frames: {seconds:.1f} s and {size / 1e6:.2f} MB for one, "
        f"so about {plan.count * seconds / 3600:.2g} h of work (here by {count} workers, at best "
        f"{plan.count * seconds / 3600 / count:.2g} h) and {plan.count * size / 1e9:.2g} GB; "
        f"{shutil.disk_usage(folder).free / 1e9:.1f} GB are free"
    )
    return "\n".join(lines)
