"""How far a batch is: a bar on a terminal, a line a minute in a log."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
from rich.progress import Progress as Bars

if TYPE_CHECKING:
    from ripple_sim.batch.run_options import Progress

_BETWEEN = 60.0  # lines in a log [s]


def progress_text(progress: Progress) -> str:
    """Frames, rate, time left, failures, room taken and left on the disk, in a line."""
    left = progress.scenes - progress.finished - progress.aside
    parts = [f"{progress.frames} frames"]
    if progress.made and progress.seconds:
        rate = progress.made / progress.seconds
        parts += [f"{3600 * rate:.0f} scenes/h", f"{duration_text(left / rate)} left"]
    if progress.failures or progress.aside:
        parts.append(f"{progress.failures} failed, {progress.aside} put aside")
    return ", ".join([*parts, f"{progress.bytes / 1e9:.2f} GB written", f"{progress.free / 1e9:.1f} GB free"])


def duration_text(seconds: float) -> str:
    """A time in seconds, minutes and hours."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


@contextlib.contextmanager
def batch_progress() -> Iterator[Callable[[Progress], None]]:
    """Yield a function that shows a batch's progress on stderr."""
    if not sys.stderr.isatty():
        yield _Log()
        return
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("scenes, {task.description}"))
    with Bars(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("", total=None)
        yield lambda now: bars.update(
            task, total=now.scenes, completed=now.finished + now.aside, description=progress_text(now)
        )


class _Log:
    """Writes a line now and then."""

    def __init__(self) -> None:
        self._last = time.monotonic()

    def __call__(self, progress: Progress) -> None:
        if time.monotonic() - self._last >= _BETWEEN:
            self._last = time.monotonic()
            done = progress.finished + progress.aside
            print(f"{done} of {progress.scenes} scenes, {progress_text(progress)}", file=sys.stderr, flush=True)
