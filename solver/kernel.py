"""Compiled loops: every numba kernel of the project is declared by `@kernel`.

A kernel has hints for whoever reads it (numba takes its types from the call), and its docstring gives shapes and
units. Arrays that belong together travel as one NamedTuple. Each thread runs kernels without the interpreter's lock.
There is no fast-math unless a kernel asks for it: the same input gives the same output, bit for bit. Compiled kernels
are kept on disk. Numba notices a change of a kernel's own file only: delete the *.nbi files after editing one that
others call.

A kernel is compiled at its first call, which takes seconds, once a machine: `compile_times` and `work_clock` tell that
from work.
"""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable
from typing import Any, TypeAlias

import numba
import numpy as np
from numba.core import event
from numba.extending import overload, register_jitable
from numpy.typing import NDArray


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


Floats: TypeAlias = NDArray[np.float64]
Floats32: TypeAlias = NDArray[np.float32]
Ints: TypeAlias = NDArray[np.int64]
Ints32: TypeAlias = NDArray[np.int32]
Bools: TypeAlias = NDArray[np.bool_]


def kernel(function: Callable | None = None, **options: Any) -> Any:
    """Compile a function at its first call: `@kernel`, or `@kernel(inline="always")` with options of `numba.njit`.

    A kernel cannot call itself. One that only kernels call and that takes many arrays compiles quicker with
    `no_cpython_wrapper=True`: without the code that unpacks what Python hands over. With the environment variable
    NUMBA_DISABLE_JIT=1 kernels are plain Python, for a debugger.
    """
    # nobody calls kernels through pointers: without the wrappers for that a tenth less is compiled
    options = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}
    return numba.njit(**options) if function is None else numba.njit(**options)(function)


def shared(function: Callable) -> Any:
    """Declare a function, written for numbers and arrays alike, that both kernels and plain Python call."""
    return register_jitable(function)


def variant(declared: Any, first: type) -> Callable[[Callable], Callable]:
    """Decorate the version of a `functools.singledispatch` function for a first argument of this NamedTuple.

    Kernels and plain Python call the declared function, and get the version. So compiled code is open to kinds that it
    does not know: whoever declares the function need not import them.
    """

    def register(version: Callable) -> Callable:
        declared.register(first)(version)

        @overload(declared)
        @functools.wraps(version)
        def choose(*arguments: Any) -> Callable | None:
            return version if getattr(arguments[0], "instance_class", None) is first else None

        return version

    return register
