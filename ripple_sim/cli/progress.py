"""A progress bar for a terminal, which tells what is being compiled; silence for a pipe or a log."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from ripple_sim.solver.kernel import compile_times, compiling

Report = Callable[[int, int], None]


# What the kernels of a package do, in a user's words; the longest name that fits counts.
_STAGES = {
    "ripple_sim.solver.layouts.sphere_map": "the sphere map",
    "ripple_sim.solver.layouts.patches": "the charts",
    "ripple_sim.solver": "the atlas",
    "ripple_sim.solver.operator": "the wave operator",
    "ripple_sim.solver.backends": "the wave step",
    "ripple_sim.solver.waves": "loads and height maps",
    "ripple_sim.coupling": "the contacts",
    "ripple_sim.render": "the renderer",
}


class _Compiling(ProgressColumn):
    """What is being compiled, and for how many seconds so far; nothing while nothing is."""

    def render(self, task: Task) -> Text:
        module = compiling()
        if module is None:
            return Text("")
        stage = _stage(module)
        seconds = sum(time for each, time in compile_times().items() if _stage(each) == stage)
        return Text(f"compiling {stage} (once): {seconds:.0f} s")


def _stage(module: str) -> str:
    """What a module's kernels do."""
    fitting = [package for package in _STAGES if f"{module}.".startswith(f"{package}.")]
    return _STAGES[max(fitting, key=len)] if fitting else module


class _Rate(ProgressColumn):
    def render(self, task: Task) -> Text:
        return Text(f"{task.speed:.1f} frames/s" if task.speed else "", style="progress.data.speed")


@contextlib.contextmanager
def frame_progress(title: str, total: int | None = None) -> Iterator[Report | None]:
    """Show a title, and below it frames done of a total, rate and remaining time, on stderr while the block runs.

    Yields a function of the number of frames done and of all frames, or None if stderr is not a terminal.
    """
    if not sys.stderr.isatty():
        yield None
        return
    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("frames"), _Rate(), TimeRemainingColumn(), _Compiling())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        progress.console.print(title, markup=False, highlight=False)
        task = progress.add_task("", total=total)
        yield lambda done, total: progress.update(task, completed=done, total=total)
