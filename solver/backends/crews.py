"""How many threads take a wave step on the CPU, and the threads themselves.

Threads pay where a substep takes longer than the meetings that it needs: on large surfaces, on a
machine whose cores have nothing else to do. Heights are the same, bit for bit, with any number.
"""

from __future__ import annotations

import concurrent.futures
import os
import threading
from collections.abc import Callable

import numba
import numpy as np

from ..compile_clock import work_clock
from ..cores import core_count
from ..errors import SolverError
from .meeting import Crew, abandon, alone
from .pace import Pace

# Environment variable: the number of threads where a program names none.
THREADS_VARIABLE = "RIPPLE_SIM_THREADS"

# A number of threads beyond this one is a mistake.
_MAX_THREADS = 1024

# Texels below which a step is taken by one thread: two threads were no faster there.
_MIN_TEXELS = 200_000

# Texels for each thread, at least: a substep of so many takes 0.1 ms or more, against two or three
# meetings of some microseconds.
_MIN_TEXELS_EACH = 100_000


def checked_threads(threads: int | None) -> int | None:
    """The number of threads that is asked for; the environment's where it is None.

    Raises
    ------
    SolverError
        If it is no whole number from 1 to 1024.
    """
    named = "threads"
    value: int | str | None = threads
    if threads is None:
        named = f"the environment variable {THREADS_VARIABLE}"
        value = os.environ.get(THREADS_VARIABLE, "").strip() or None
    if value is None:
        return None
    text = str(value)
    is_whole = text.isascii() and text.isdigit() and not isinstance(value, bool)
    if not is_whole or not 1 <= int(text) <= _MAX_THREADS:
        raise SolverError(
            f"{named} must be a whole number from 1 to {_MAX_THREADS}, got {value!r}; without it "
            "as many threads run as pay"
        )
    return int(text)


def thread_count(texels: int, threads: int | None) -> int:
    """Threads that step a surface: the given number, or the fastest number on these cores."""
    if numba.config.DISABLE_JIT:
        return 1
    if threads is not None:
        return threads
    if texels < _MIN_TEXELS:
        return 1
    return min(core_count(), texels // _MIN_TEXELS_EACH)


class _Pool:
    """The threads of this process that wait for a step."""

    def __init__(self) -> None:
        self.in_use = threading.Lock()
        self.size = 0
        self.executor: concurrent.futures.ThreadPoolExecutor | None = None

    def of(self, size: int) -> concurrent.futures.ThreadPoolExecutor:
        """At least `size` threads."""
        if self.executor is None or self.size < size:
            if self.executor is not None:
                self.executor.shutdown()
            self.executor = concurrent.futures.ThreadPoolExecutor(size, "ripple-sim-step")
            self.size = size
        return self.executor


_pool = _Pool()


def _begin_anew() -> None:
    """A process that was forked has none of its parent's threads, and maybe a lock that is held."""
    global _pool
    _pool = _Pool()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_anew)


class Team:
    """The threads that step one surface.

    Parameters
    ----------
    texels : int
        Size of the surface.
    threads : int, optional
        Number of threads. By default the number that is fastest: see `Pace`.
    """

    def __init__(self, texels: int, threads: int | None) -> None:
        self._is_fixed = threads is not None
        self._pace = Pace(thread_count(texels, threads))

    def run(self, task: Callable[[Crew], object], substeps: int) -> None:
        """Run a task of some substeps in each of the threads."""
        if self._is_fixed:
            run_together(task, self._pace.threads)
            return
        threads = self._pace.choose()
        begin = work_clock()
        run_together(task, threads)
        self._pace.note(threads, (work_clock() - begin) / substeps)


def run_together(task: Callable[[Crew], object], size: int) -> None:
    """Run a task in `size` threads at once; the calling thread is the first.

    Where another step has the threads, the calling thread does all of the task.
    """
    pool = _pool
    if size == 1 or not pool.in_use.acquire(blocking=False):
        task(alone())
        return
    counters = np.zeros(2, np.int64)
    futures: list[concurrent.futures.Future] = []
    try:
        executor = pool.of(size - 1)
        for rank in range(1, size):
            futures.append(executor.submit(task, Crew(rank, size, counters)))
        task(Crew(0, size, counters))
    except BaseException:
        abandon(counters)
        raise
    finally:
        concurrent.futures.wait(futures)
        pool.in_use.release()
    for future in futures:
        future.result()
