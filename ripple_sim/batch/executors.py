"""Executors of a batch: processes of this machine, or the workers of a Dask cluster.

All of them share the folder of the batch.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import logging
import math
import multiprocessing
import os
import queue
import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

from ripple_sim.encode.locks import locked
from ripple_sim.errors import BatchError
from ripple_sim.solver.cores import available_cores
from ripple_sim.solver.errors import shown, user_line, work_for

# Tasks for each Dask thread: with two, no thread waits for its next task.
_TASKS_PER_THREAD = 2

# The signal that ends a process at once: Windows has one such, and calls it SIGTERM.
_KILL = getattr(signal, "SIGKILL", signal.SIGTERM)

# Time between two counts of the threads of a Dask cluster [s]: its scheduler takes a while to
# answer.
_COUNT_INTERVAL = 2.0

# Time that a Dask scheduler has to answer at first [s].
_ANSWER_TIME = 20


class DaskExecutor(Executor):
    """The workers of a Dask cluster, however many there are at the time.

    Parameters
    ----------
    address : str
        Of the scheduler, such as tcp://host:8786.

    Raises
    ------
    BatchError
        If Dask is not installed or does not answer.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise BatchError(
                "--dask needs Dask; install it with: pip install 'ripple-sim[dask]'"
            ) from error
        try:
            self._client = Client(address, timeout=_ANSWER_TIME, set_as_default=False)
        except (OSError, ValueError) as error:
            raise BatchError(
                f"no Dask scheduler answers at {shown(address)} ({error}): give an address such "
                "as tcp://host:8786"
            ) from error
        self._address = address
        self._log = logging.getLogger("distributed.client")
        # the message of `refusal` is enough if the scheduler is gone
        self._silence = lambda record: False
        self._log.addFilter(self._silence)
        self._places = 0
        self._latest_count = -math.inf  # time of the latest count of threads [s]
        self._executor = self._client.get_executor(pure=False, retries=0)

    @property
    def places(self) -> int:
        """How many tasks may be submitted at a time."""
        if time.monotonic() - self._latest_count > _COUNT_INTERVAL:
            threads = sum(self._client.nthreads().values())
            self._places = _TASKS_PER_THREAD * max(1, threads)
            self._latest_count = time.monotonic()
        return self._places

    def submit(self, function: Callable, /, *arguments: Any, **named: Any) -> Future:
        """Have a function called by one of the workers."""
        return self._executor.submit(function, *arguments, **named)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster; without `wait`, unfinished work is dropped."""
        self._log.removeFilter(self._silence)
        self._executor.shutdown(wait=wait)
        self._client.close()

    def refusal(self) -> BatchError | None:
        """What to raise in place of Dask's own errors if its scheduler is gone."""
        if self._client.status == "running":
            return None
        return BatchError(
            f"the Dask scheduler at {self._address} is gone; finished scenes are kept: start it, "
            "and run the same command again to go on"
        )


def usual_workers() -> int:
    """Default number of workers: one for every two cores, and at least two on two cores."""
    cores = len(available_cores())
    return max(2, cores // 2) if cores > 1 else 1


def shares(cores: list[int], workers: int) -> list[list[int]]:
    """Divide the cores among the workers as evenly as possible.

    If there are more workers than cores, every worker may use all cores.
    """
    if workers > len(cores):
        return [cores] * workers
    ends = [len(cores) * number // workers for number in range(workers + 1)]
    return [cores[first:last] for first, last in itertools.pairwise(ends)]


class LocalExecutor(Executor):
    """Spawned processes, each with a core or more and an OpenGL context of its own.

    If a process dies, its task fails, and another process replaces it. All processes end with this
    one, however it ends. At most `places` tasks may be submitted at a time, one a process.
    """

    def __init__(self, workers: int) -> None:
        self.places = workers
        self._free_places: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._cores = shares(available_cores(), workers)
        self._user_line = user_line()
        # by place: a pool of one process, and the id of the process
        self._pools: dict[int, tuple[ProcessPoolExecutor, Future[int]]] = {}
        for place in range(workers):
            self._free_places.put(place)

    def submit(self, function: Callable, /, *arguments: Any, **named: Any) -> Future:
        """Have a function called in one of the processes; at most `places` tasks at a time."""
        place = self._free_places.get_nowait()
        try:
            future = self._pool(place).submit(function, *arguments, **named)
        except BrokenProcessPool:  # the process died while it had nothing to do
            del self._pools[place]
            future = self._pool(place).submit(function, *arguments, **named)
        future.add_done_callback(functools.partial(self._release, place))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes; without `wait`, end them at once and drop unfinished work."""
        for pool, process_id in list(self._pools.values()):
            if not wait and process_id.done() and not process_id.exception():
                with contextlib.suppress(OSError):  # it has ended by itself
                    os.kill(process_id.result(), _KILL)
            pool.shutdown(wait, cancel_futures=cancel_futures)

    def _pool(self, place: int) -> ProcessPoolExecutor:
        """The process of a place, which is started at its first task."""
        if place not in self._pools:
            spawn = multiprocessing.get_context("spawn")  # OpenGL does not survive a fork
            arguments = self._cores[place], self._user_line
            pool = ProcessPoolExecutor(1, mp_context=spawn, initializer=_begin, initargs=arguments)
            self._pools[place] = pool, pool.submit(os.getpid)
        pool, _ = self._pools[place]
        return pool

    def _release(self, place: int, future: Future) -> None:
        """Free the place of a task that has ended, and give up its process if it has died."""
        if not future.cancelled() and isinstance(future.exception(), BrokenProcessPool):
            pool, _ = self._pools.pop(place)
            pool.shutdown(wait=False)
        self._free_places.put(place)


def _begin(cores: list[int], line: tuple[str, int]) -> None:
    """Set up a worker process before it imports anything heavy.

    The process gets its share of the cores, and the user's line that its warnings name.
    """
    work_for(line)
    # Ctrl-C reaches all processes; the parent ends this one
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, cores)
    # llvmpipe with threads may end the process; see docs/stability.md
    os.environ.setdefault("LP_NUM_THREADS", "0")
    for variable in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, str(len(cores)))
    os.environ.setdefault("MUJOCO_GL", "disable")
    logging.getLogger("ripple_sim").setLevel(logging.ERROR)  # the parent shows the progress
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Wait until the parent process has ended, then end this one."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextlib.contextmanager
def first_alone(work: Path, task: str) -> Iterator[None]:
    """Run the block alone on this machine the first time that a task is done.

    Processes that share the folder `work` wait until the first one has done it.
    """
    ready = work / f"ready-{socket.gethostname()}-{task}"
    if not ready.exists():
        with locked(work / f"first-{socket.gethostname()}-{task}"):
            if not ready.exists():
                yield
                ready.touch()
                return
    yield
