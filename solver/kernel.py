"""Compiled loops: every numba kernel of the project is declared by `@kernel`.

A kernel has hints for whoever reads it (numba takes its types from the call), and its docstring
gives shapes and units. Arrays that belong together travel as one NamedTuple. Each thread runs
kernels without the interpreter's lock. There is no fast-math unless a kernel asks for it: the same
input gives the same output, bit for bit.

A kernel is compiled at its first call, which takes seconds, and kept on disk: see `kernel_cache`.
`compile_clock` measures how long the compilation takes.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from typing import Any, TypeAlias

import numba
import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from . import compile_clock as compile_clock  # it listens from the first compilation on
from .kernel_cache import compile_for_plain_types, keep_on_disk

# The project's log: work that takes long without anything to see. It goes to standard error, unless
# the user's program says otherwise.
log = logging.getLogger("ripple_sim")

Floats: TypeAlias = NDArray[np.float64]
Floats32: TypeAlias = NDArray[np.float32]
Ints: TypeAlias = NDArray[np.int64]
Ints32: TypeAlias = NDArray[np.int32]
Bools: TypeAlias = NDArray[np.bool_]

# Options of `numba.njit` for all kernels. Nobody calls kernels through pointers: without the
# wrappers for such calls a tenth less is compiled.
_OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}

# Declares a function, written for numbers and arrays alike, that both kernels and plain Python
# call.
shared = register_jitable


def kernel(function: Callable | None = None, **options: Any) -> Any:
    """Compile a function at its first call: `@kernel`, or `@kernel(inline="always")`.

    The options are those of `numba.njit`. A kernel cannot call itself. A kernel that only kernels
    call and that takes many arrays compiles quicker with `no_cpython_wrapper=True`: without the
    code that unpacks Python's arguments. With the environment variable NUMBA_DISABLE_JIT=1 kernels
    are plain Python, for a debugger.
    """
    if function is None:
        return functools.partial(kernel, **options)
    compiled = numba.njit(**(_OPTIONS | options))(function)
    is_plain_python = compiled is function  # with NUMBA_DISABLE_JIT
    if not is_plain_python:
        keep_on_disk(compiled, function)
        compile_for_plain_types(compiled)
    return compiled
