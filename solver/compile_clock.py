"""Time spent on compiling kernels, apart from the time spent on work.

A kernel is compiled at its first call, which takes seconds, once on each machine. `compile_times`
and `compiling` say which modules are compiled, `stage_of` what their kernels compute; `work_clock`
leaves the compilation out.

numba tells of compilations by the events of `numba.core.event`.
"""

from __future__ import annotations

import gc
import logging
import threading
import time
from typing import Any

from numba.core import event

# Kernels are compiled in silence for this long [s]; then warnings say why it takes so long.
_SILENT_SECONDS = 2.0

# What the kernels of a package compute, in a user's words. The longest matching name is taken.
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

_log = logging.getLogger("ripple_sim")


class _CompileListener(event.Listener):
    """Seconds of compilation, by module and by thread.

    A kernel that is compiled for another kernel is part of the other kernel's time. Python's
    garbage collector is off meanwhile: it would go through all that numba makes, a sixth of the
    time.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        # module that is being compiled, and when it began; numba compiles one kernel at a time
        self.running: tuple[str, float] | None = None
        self.own = threading.local()  # of this thread: depth of nested compilations, seconds
        self.named: set[str] = set()  # stages that a warning has named
        self._collected_before = False  # whether the garbage collector was on

    def on_start(self, event: Any) -> None:
        """A kernel begins to be compiled."""
        self.own.depth = getattr(self.own, "depth", 0) + 1
        if self.own.depth > 1:
            return
        self._collected_before = gc.isenabled()
        gc.disable()
        module = event.data["dispatcher"].py_func.__module__
        self.running = module, time.perf_counter()
        stage = stage_of(module)
        if stage not in self.named and sum(self.seconds.values()) > _SILENT_SECONDS:
            self.named.add(stage)
            _log.warning("compiling %s for this machine, once; later runs load it", stage)

    def on_end(self, event: Any) -> None:
        """A kernel has been compiled."""
        self.own.depth -= 1
        if self.own.depth > 0 or self.running is None:
            return
        if self._collected_before:
            gc.enable()
        module, start = self.running
        spent = time.perf_counter() - start
        self.seconds[module] = self.seconds.get(module, 0.0) + spent
        self.own.seconds = getattr(self.own, "seconds", 0.0) + spent
        self.running = None


def stage_of(module: str) -> str:
    """A phrase for users: what the kernels of a module compute, or else the module's name."""
    fitting = [package for package in _STAGES if f"{module}.".startswith(f"{package}.")]
    return _STAGES[max(fitting, key=len)] if fitting else module


_listener = _CompileListener()
event.register("numba:compile", _listener)


def work_clock() -> float:
    """A clock [s] that stands still while this thread compiles kernels."""
    return time.perf_counter() - getattr(_listener.own, "seconds", 0.0)


def compile_times() -> dict[str, float]:
    """Time that all threads together have spent on compiling the kernels of each module [s]."""
    times = dict(_listener.seconds)
    running = _listener.running
    if running is not None:
        module, start = running
        times[module] = times.get(module, 0.0) + time.perf_counter() - start
    return times


def compiling() -> str | None:
    """Module whose kernels are being compiled now, in any thread, or None."""
    running = _listener.running
    return None if running is None else running[0]
