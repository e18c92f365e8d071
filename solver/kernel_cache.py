"""Compiled kernels on disk, and every other use of numba's private interface.

numba's own cache trusts whatever its files hold. Here each file has a checksum, and a fingerprint
of the kernel's module and of all modules of the project that this module imports. A kernel whose
file is damaged, or older than a source, is compiled again. Kernels that were compiled under other
settings of numba, such as NUMBA_BOUNDSCHECK, have files of their own.

The private parts of numba that are used, for which `pyproject.toml` limits numba's version:

- `FunctionCache`: `_name`, `_py_func`, `_cache_file`, `_impl`, and how it calls `load` and `save`;
- `CompileResultCacheImpl`: how compiled code becomes data that can be pickled, and `_locator`;
- `numba.core.serialize.dumps`;
- a dispatcher's `_cache` and `get_call_template`.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.util
import os
import pickle
import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps

from .cache import cache_folder

# Settings of numba, by their names in `numba.config`, that change what a kernel is compiled to.
# The settings of the processor are in numba's own key.
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

# Bytes of a SHA-256 checksum, with which each file begins.
_CHECKSUM_BYTES = 32

# Hexadecimal digits of a hash that are part of the name of a file, and of a folder: enough that
# two never meet by chance.
_FILE_DIGITS = 16
_FOLDER_DIGITS = 12

# An import of a module of the project, at the top of a module
_IMPORT = re.compile(r"^from +(\.[.\w]*|ripple_sim[.\w]*) +import +(\([^)]*\)|.*)", re.MULTILINE)

_SMALL_INTEGERS = (numba.types.int8, numba.types.int16, numba.types.int32)


def keep_on_disk(compiled: Any, function: Callable) -> None:
    """Let a dispatcher of numba load versions of a function from disk, and save them there."""
    compiled._cache = _KernelCache(function)


def compile_for_plain_types(compiled: Any) -> None:
    """Let other kernels call a dispatcher with plain types alone, see `_plain`."""
    get_call_template = compiled.get_call_template

    def get_plain_call_template(arguments: Any, keywords: Any) -> Any:
        return get_call_template([_plain(kind) for kind in arguments], keywords)

    compiled.get_call_template = get_plain_call_template


def _plain(kind: Any) -> Any:
    """The numba type that a kernel is called with instead of `kind`.

    There is then no version of a kernel for each literal number, or for small integers.
    """
    kind = numba.types.unliteral(kind)
    return numba.types.int64 if kind in _SMALL_INTEGERS else kind


class _KernelCache(FunctionCache):
    """Compiled versions of one kernel on disk, instead of numba's own cache."""

    def __init__(self, function: Callable) -> None:
        self._name = repr(function)
        self._py_func = function
        self._cache_file = self
        # numba's way from compiled code to data that can be pickled; its `__init__` would look for
        # a folder, which is known here
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
        """The compiled code of a key of numba's, or None."""
        path = self._path(key)
        with contextlib.suppress(Exception):  # of any kind: the kernel is then compiled
            content = path.read_bytes()
            pickled = content[_CHECKSUM_BYTES:]
            if content[:_CHECKSUM_BYTES] == _checksum(path, pickled):
                stored_key, sources, data = pickle.loads(pickled)
                if stored_key == key and sources == fingerprint(self._py_func.__module__):
                    return data
        return None

    def save(self, key: Any, data: Any) -> None:
        """Save the compiled code of a key of numba's.

        Nothing is saved if the disk is full or cannot be written, or if the sources have changed
        since they were imported.
        """
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
        name = f"{self._py_func.__module__}.{self._py_func.__qualname__}"
        name = name.replace("<", "").replace(">", "")
        settings = [getattr(numba.config, setting, None) for setting in _CODE_SETTINGS]
        version = f"{sys.version} {numba.__version__} {settings} {key}"
        digits = hashlib.sha256(version.encode()).hexdigest()[:_FILE_DIGITS]
        return kernel_folder() / f"{name}-{digits}.kernel"


def _checksum(path: Path, content: bytes) -> bytes:
    return hashlib.sha256(path.name.encode() + content).digest()


@functools.cache
def kernel_folder() -> Path:
    """Folder of the compiled kernels.

    It is in NUMBA_CACHE_DIR if that is set, else beside the source, or, where nobody may write
    there, in the user's cache folder.
    """
    if numba.config.CACHE_DIR:
        return Path(numba.config.CACHE_DIR) / "ripple-sim"
    package = Path(__file__).parent
    beside = package / "__pycache__" / "kernels"
    try:
        beside.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=beside):
            return beside
    except OSError:
        # each installation has a folder of its own
        installation = hashlib.sha256(os.fsencode(package)).hexdigest()[:_FOLDER_DIGITS]
        return cache_folder() / "kernels" / installation


@functools.cache
def fingerprint(module: str) -> str:
    """Hash of the text of a module and of all modules of the project that it imports.

    The modules that those modules import count as well, and so on.
    """
    source = Path(sys.modules[module].__file__ or "").read_text(encoding="utf-8")
    imported = set()
    for base, names in _IMPORT.findall(source):
        base = importlib.util.resolve_name(base, sys.modules[module].__package__ or "")
        for name in re.findall(r"\w+", names):
            imported.add(f"{base}.{name}" if f"{base}.{name}" in sys.modules else base)
    texts = [source, *map(fingerprint, sorted(imported))]
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()
