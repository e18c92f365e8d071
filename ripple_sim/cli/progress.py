"""A progress bar for a terminal; silence for a pipe or a log."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

Report = Callable[[int, int], None]


class _Rate(ProgressColumn):
    def render(self, task: Task) -> Text:
        return Text(f"{task.speed:.1f} frames/s" if task.speed else "", style="progress.data.speed")


@contextlib.contextmanager
def frame_progress(title: str) -> Iterator[Report | None]:
    """Show a title, and below it frames done, rate and remaining time, on stderr while the block runs.

    Yields a function of the number of frames done and of all frames, or None if stderr is not a terminal.
    """
    if not sys.stderr.isatty():
        yield None
        return
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("frames"), _Rate(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        progress.console.print(title, markup=False, highlight=False)
        task = progress.add_task("", total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)
