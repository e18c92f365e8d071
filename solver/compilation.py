"""Compilation, told apart from work: a kernel is compiled at its first call, which takes seconds, once a machine."""

from __future__ import annotations

import threading
import time
from typing import Any

from numba.core import event


class _Watch(event.Listener):
    """Seconds of compilation by module, and in this thread; a kernel that is compiled for another is part of it."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.running: tuple[str, float] | None = None  # module, and when it began; numba compiles one at a time
        self.own = threading.local()

    def on_start(self, event: Any) -> None:
        """A kernel begins to be compiled."""
        self.own.depth = getattr(self.own, "depth", 0) + 1
        if self.own.depth == 1:
            self.running = event.data["dispatcher"].py_func.__module__, time.perf_counter()

    def on_end(self, event: Any) -> None:
        """It has been compiled."""
        self.own.depth -= 1
        if self.own.depth == 0 and self.running is not None:
            module, start = self.running
            spent = time.perf_counter() - start
            self.seconds[module] = self.seconds.get(module, 0.0) + spent
            self.own.seconds = getattr(self.own, "seconds", 0.0) + spent
            self.running = None


_watch = _Watch()
event.register("numba:compile", _watch)


def work_clock() -> float:
    """A clock [s] that stands still while this thread compiles kernels."""
    return time.perf_counter() - getattr(_watch.own, "seconds", 0.0)


def compile_times() -> dict[str, float]:
    """How long all threads have compiled the kernels of each module so far [s]."""
    times, running = dict(_watch.seconds), _watch.running
    if running is not None:
        module, start = running
        times[module] = times.get(module, 0.0) + time.perf_counter() - start
    return times


def compiling() -> str | None:
    """Module whose kernels are being compiled now, in whatever thread, or None."""
    running = _watch.running
    return None if running is None else running[0]
