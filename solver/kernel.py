"""Compiled loops: every numba kernel of the project is declared by `@kernel`.

A kernel has hints for whoever reads it (numba takes its types from the call), and its docstring
gives shapes and units. Arrays that belong together travel as one NamedTuple. Each thread runs
kernels without the interpreter's lock. There is no fast-math unless a kernel asks for it: the same
input gives the same output, bit for bit.

Compiled kernels are kept on disk, each with a checksum and a fingerprint of its module and of all
that this imports: one that is damaged, or older than a source, is compiled anew. Those compiled
under other settings of numba, such as NUMBA_BOUNDSCHECK, lie beside them under other names.

A kernel is compiled at its first call, which takes seconds, once a machine: `compile_times` and
`work_clock` tell that from work.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import importlib.util
import logging
import os
import pickle
import re
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

import numba
import numpy as np
from numba.core import event
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps
from numba.extending import register_jitable
from numpy.typing import NDArray

from .cache import cache_folder

# What takes long without anything to see is told here: on standard error, unless the user's program
# says otherwise.
log = logging.getLogger("ripple_sim")

# How long kernels are compiled in silence [s].
_SILENT = 2.0

# Settings of numba, by their names in `numba.config`, that change what a kernel is compiled to.
# Those of the processor are in numba's own key.
_CODE_SETTINGS = (
    "BOUNDSCHECK",
    "DEBUGINFO_DEFAULT",
    "EXTEND_VARIABLE_LIFETIMES",
    "ENABLE_PROFILING",
    "DEBUG_JIT",
    "DEBUG_NRT",
    "DEBUG_NRT_STACK_LIMIT",
    "NRT_STATS",
    "DEBUG_ARRAY_OPT_RUNTIME",
    "PARFOR_MAX_TUPLE_SIZE",
    "DIFF_IR",
    "OPT",
    "LOOP_VECTORIZE",
    "SLP_VECTORIZE",
    "USING_SVML",
    "LLVM_REFPRUNE_PASS",
    "LLVM_REFPRUNE_FLAGS",
)

# An import at the top of a module, of the project's own
_IMPORT = re.compile(r"^from +(\.[.\w]*|ripple_sim[.\w]*) +import +(\([^)]*\)|.*)", re.MULTILINE)


class _CompileListener(event.Listener):
    """Seconds of compilation by module, and in this thread; a kernel that is compiled for another is part of it.

    Meanwhile Python looks for no garbage: it would go through all that numba makes, a sixth of the
    time.
    """

    def __init__(self) -> None:
        self.collects = False  # whether Python does otherwise
        self.seconds: dict[str, float] = {}
        # module, and when it began; numba compiles one at a time
        self.running: tuple[str, float] | None = None
        self.own = threading.local()
        self.told = False

    def on_start(self, event: Any) -> None:
        """A kernel begins to be compiled."""
        self.own.depth = getattr(self.own, "depth", 0) + 1
        if self.own.depth == 1:
            self.collects = gc.isenabled()
            gc.disable()
            self.running = event.data["dispatcher"].py_func.__module__, time.perf_counter()
            if not self.told and sum(self.seconds.values()) > _SILENT:
                self.told = True
                log.warning(
                    "compiling for this machine, once; it may take a minute, and later runs load "
                    "what is made"
                )

    def on_end(self, event: Any) -> None:
        """A kernel has been compiled."""
        self.own.depth -= 1
        if self.own.depth == 0 and self.running is not None:
            if self.collects:
                gc.enable()
            module, start = self.running
            spent = time.perf_counter() - start
            self.seconds[module] = self.seconds.get(module, 0.0) + spent
            self.own.seconds = getattr(self.own, "seconds", 0.0) + spent
            self.running = None


_watch = _CompileListener()
event.register("numba:compile", _watch)


def work_clock() -> float:
    """A clock [s] that stands still while this thread compiles kernels."""
    return time.perf_counter() - getattr(_watch.own, "seconds", 0.0)


def compile_times() -> dict[str, float]:
    """How long all threads have compiled the kernels of each module so far [s]."""
    times = dict(_watch.seconds)
    running = _watch.running
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

    A kernel cannot call itself. One that only kernels call and that takes many arrays compiles
    quicker with `no_cpython_wrapper=True`: without the code that unpacks what Python hands over.
    With the environment variable NUMBA_DISABLE_JIT=1 kernels are plain Python, for a debugger.
    """
    if function is None:
        return functools.partial(kernel, **options)
    # nobody calls kernels through pointers: without the wrappers for that a tenth less is compiled
    options = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **options}
    compiled = numba.njit(**options)(function)
    if compiled is not function:  # which it is with NUMBA_DISABLE_JIT
        compiled._cache = _KernelCache(function)
        template = compiled.get_call_template
        compiled.get_call_template = lambda args, kws: template(
            [_plain(each) for each in args], kws
        )
    return compiled


def _plain(kind: Any) -> Any:
    """The type that kernels are called with for one of numba's: no version for each number, or for small integers."""
    kind = numba.types.unliteral(kind)
    return (
        numba.types.int64
        if kind in (numba.types.int8, numba.types.int16, numba.types.int32)
        else kind
    )


class _KernelCache(FunctionCache):
    """Compiled versions of one kernel on disk, in place of numba's own cache, which trusts whatever its files hold."""

    def __init__(self, function: Callable) -> None:
        self._name = repr(function)
        self._py_func = function
        self._cache_file = self
        # how numba turns what it has compiled into what can be pickled; it need not find out where
        # that is kept
        self._impl = CompileResultCacheImpl.__new__(CompileResultCacheImpl)
        self._impl._locator = self
        self.enable()

    def ensure_cache_path(self) -> None:
        """Do nothing: files make their folder."""

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(kernel_folder())

    def load(self, key: Any) -> Any:
        """What was compiled for a key of numba's, or None."""
        path = self._path(key)
        with contextlib.suppress(Exception):  # whatever a file holds, a kernel can be compiled
            content = path.read_bytes()
            if content[:32] == _checksum(path, content[32:]):
                stored, sources, data = pickle.loads(content[32:])
                if stored == key and sources == fingerprint(self._py_func.__module__):
                    return data
        return None

    def save(self, key: Any, data: Any) -> None:
        """Keep what was compiled, unless the disk is full or cannot be written, or the sources are newer by now."""
        path = self._path(key)
        try:
            content = dumps((key, fingerprint(self._py_func.__module__), data))
        except (KeyError, OSError):  # a newer source imports what was not there, or is gone
            return
        unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
        with contextlib.suppress(OSError):
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                unfinished.write_bytes(_checksum(path, content) + content)
                unfinished.replace(path)  # also where a link to somebody's file lies
            finally:
                unfinished.unlink(missing_ok=True)

    def _path(self, key: Any) -> Path:
        name = f"{self._py_func.__module__}.{self._py_func.__qualname__}".replace("<", "").replace(
            ">", ""
        )
        settings = [getattr(numba.config, setting, None) for setting in _CODE_SETTINGS]
        version = hashlib.sha256(
            f"{sys.version} {numba.__version__} {settings} {key}".encode()
        ).hexdigest()[:16]
        return kernel_folder() / f"{name}-{version}.kernel"


def _checksum(path: Path, content: bytes) -> bytes:
    return hashlib.sha256(path.name.encode() + content).digest()


@functools.cache
def kernel_folder() -> Path:
    """Where compiled kernels are: in NUMBA_CACHE_DIR, beside the source, or in the user's cache folder."""
    if numba.config.CACHE_DIR:
        return Path(numba.config.CACHE_DIR) / "ripple-sim"
    beside = Path(__file__).parent / "__pycache__" / "kernels"
    try:
        beside.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=beside):
            return beside
    except OSError:
        # each installation has its own
        place = hashlib.sha256(os.fsencode(Path(__file__).parent)).hexdigest()[:12]
        return cache_folder() / "kernels" / place


@functools.cache
def fingerprint(module: str) -> str:
    """Hash of the text of a module of the project and of all that it imports, at whatever distance."""
    source = Path(sys.modules[module].__file__ or "").read_text(encoding="utf-8")
    imported = set()
    for base, names in _IMPORT.findall(source):
        base = importlib.util.resolve_name(base, sys.modules[module].__package__ or "")
        for name in re.findall(r"\w+", names):
            imported.add(f"{base}.{name}" if f"{base}.{name}" in sys.modules else base)
    return hashlib.sha256(
        "\0".join([source, *map(fingerprint, sorted(imported))]).encode()
    ).hexdigest()


# Declares a function, written for numbers and arrays alike, that both kernels and plain Python
# call.
shared = register_jitable
