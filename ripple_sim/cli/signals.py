"""Ctrl-C, SIGTERM and SIGHUP: one line, status 128 + the signal's number, and what is unfinished is cleaned up.

Before a command begins, and during imports, where an exception could be taken for an import error, there is nothing to
clean up, and the process ends at once. Later the signal becomes an exception, but never within a call of moderngl's or
LLVM's, which would end in a segmentation fault, nor within VTK's, which swallows exceptions of what it calls back or
exits by itself, nor within zarr's, whose threads would go on to write into a folder that is being removed, nor while a
video is being opened: then a timer tries again until it is over.
A second signal ends the process at once; what is left is then as whole as after a kill. One that comes after the
command, while the interpreter shuts down, changes nothing.
"""

from __future__ import annotations

import functools
import os
import signal
import sys
from collections.abc import Callable, Iterator
from types import CodeType, FrameType
from typing import Any

_WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated", signal.SIGHUP: "hung up"}
INTERRUPTED, TERMINATED, HUNG_UP = (128 + number for number in _WORDS)

# Files within whose calls no exception is raised, by parts of their paths.
_NEVER_IN = (
    "moderngl/__init__.py",
    "/llvmlite/binding/",
    "numba/core/codegen.py",
    "/pyvista/plotting/",
    "encode/open_writer.py",
    "zarr/core/sync.py",
)
# In whose functions an import may be under way and there is something to clean up.
_AT_STAKE = ("video/render_video.py", "export/export_scene.py", "cycles/render_cycles.py")

_RETRY = 0.02  # [s]


def word_of(status: int) -> str | None:
    """The word for an exit status of a signal, or None for any other."""
    return {128 + number: word for number, word in _WORDS.items()}.get(status)


def end_at_once() -> None:
    """Let the signals end the process, with one line; a signal ignored by the parent stays ignored."""
    signal.setitimer(signal.ITIMER_REAL, 0)
    _handle(_end)


def end_in_good_order() -> None:
    """Let the signals raise `KeyboardInterrupt` or `SystemExit`; a signal ignored by the parent stays ignored."""
    if getattr(sys.unraisablehook, "func", None) is not _retry_what_got_lost:
        sys.unraisablehook = functools.partial(_retry_what_got_lost, sys.unraisablehook)
    _handle(_raise)


def finish_undisturbed() -> None:
    """Ignore the signals from here on: the command is done, and its status stands.

    While the interpreter shuts down it would give them back to the system, which ends the process without a word.
    """
    _handle(signal.SIG_IGN)


def _handle(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> None:
    for number in _WORDS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _end(number: int, frame: FrameType | None) -> None:
    os.write(2, f"ripple-sim: {_WORDS[signal.Signals(number)]}\n".encode())
    os._exit(128 + number)


def _raise(number: int, frame: FrameType | None) -> None:
    running = list(_running(frame))
    files = [code.co_filename for code in running]
    importing = any(file.startswith("<frozen importlib") for file in files)
    at_stake = any(code.co_filename.endswith(_AT_STAKE) and code.co_name != "<module>" for code in running)
    if importing and not at_stake:
        _end(number, frame)
    if importing or any(part in file for file in files for part in _NEVER_IN):
        _retry(number)
        return
    end_at_once()
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    sys.exit(128 + number)


def _retry(number: int) -> None:
    signal.signal(signal.SIGALRM, lambda _, frame: _raise(number, frame))
    signal.setitimer(signal.ITIMER_REAL, _RETRY)


def _retry_what_got_lost(before: Callable[[Any], object], unraisable: Any) -> None:
    """An exception in a finalizer goes no further: raise it again outside."""
    error = unraisable.exc_value
    if isinstance(error, KeyboardInterrupt):
        _retry(signal.SIGINT)
    elif isinstance(error, SystemExit) and isinstance(error.code, int) and word_of(error.code):
        _retry(error.code - 128)
    else:
        before(unraisable)


def _running(frame: FrameType | None) -> Iterator[CodeType]:
    """The functions that are running, from the innermost."""
    while frame is not None:
        yield frame.f_code
        frame = frame.f_back
