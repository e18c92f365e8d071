"""Ctrl-C, SIGTERM and SIGHUP end a command with one line and status 128 + the signal's number.

Unfinished files are cleaned up.

Before a command begins there is nothing to clean up, and the process ends at once. Later the signal
becomes an exception. In some code an exception would do harm; a timer then tries again until that
code has ended:

- within calls of moderngl and LLVM it would end in a segmentation fault;
- VTK swallows exceptions of functions that it calls back, or exits by itself;
- zarr's threads would go on to write into a folder that is being removed;
- a package may take the exception for an import error;
- Python swallows exceptions in a finalizer;
- while a video is being opened, nobody would clean it up.

A second signal ends the process at once, and leaves the files behind that a kill would leave. A
signal after the command, while the interpreter shuts down, changes nothing.

Windows has no SIGHUP, and no timer that sends a signal: there a thread tries again.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType

# What is printed for each signal.
_WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
if hasattr(signal, "SIGHUP"):
    _WORDS[signal.SIGHUP] = "hung up"

# Exit statuses of the signals.
INTERRUPTED = 128 + signal.SIGINT
TERMINATED = 128 + signal.SIGTERM

# Code within which no exception is raised, by the beginnings of its dotted names.
_NEVER_IN = (
    "moderngl.",
    "llvmlite.",
    "numba.core.codegen.",
    "pyvista.plotting.",
    "zarr.core.sync.",
    "importlib._bootstrap",
    "_frozen_importlib",
    "weakref.",
    "_weakrefset.",
    "ripple_sim.encode.writer.open_writer",
)

# Time until an exception is tried again [s].
_RETRY_INTERVAL = 0.02

_HAS_TIMER = hasattr(signal, "setitimer")

# The thread that raises a signal again, where the system has no timer.
_retry_thread: threading.Timer | None = None


def word_of(status: int) -> str | None:
    """The word for the exit status of a signal; None for any other status."""
    words = {128 + number: word for number, word in _WORDS.items()}
    return words.get(status)


def end_at_once() -> None:
    """Let the signals end the process at once, with one line.

    A signal that the parent process ignores stays ignored.
    """
    _cancel_retry()
    _handle(_end)


def end_in_good_order() -> None:
    """Let the signals raise `KeyboardInterrupt` or `SystemExit`.

    A signal that the parent process ignores stays ignored.
    """
    _handle(_raise)


def finish_undisturbed() -> None:
    """Ignore the signals from here on: the command is done, and its status stands.

    While the interpreter shuts down, it would give the signals back to the system, which ends the
    process without a word.
    """
    _handle(signal.SIG_IGN)


def _handle(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> None:
    """Set the handler of all signals but those that the parent process ignores."""
    for number in _WORDS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _end(number: int, frame: FrameType | None) -> None:
    """End the process with one line."""
    os.write(2, f"ripple-sim: {_WORDS[signal.Signals(number)]}\n".encode())
    os._exit(128 + number)


def _raise(number: int, frame: FrameType | None) -> None:
    """Raise the exception of a signal, or try again later where it would do harm."""
    if _does_harm_in(frame):
        _retry(number)
        return
    end_at_once()
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    sys.exit(128 + number)


def _does_harm_in(frame: FrameType | None) -> bool:
    """Whether an exception would do harm in a frame or in any of its callers."""
    while frame is not None:
        name = f"{frame.f_globals.get('__name__', '')}.{frame.f_code.co_qualname}"
        if frame.f_code.co_name == "__del__" or name.startswith(_NEVER_IN):
            return True
        frame = frame.f_back
    return False


def _retry(number: int) -> None:
    """Have a signal handled again after a while."""
    global _retry_thread
    if _HAS_TIMER:
        signal.signal(signal.SIGALRM, lambda _, later_frame: _raise(number, later_frame))
        signal.setitimer(signal.ITIMER_REAL, _RETRY_INTERVAL)
        return
    _cancel_retry()
    _retry_thread = threading.Timer(_RETRY_INTERVAL, signal.raise_signal, [number])
    _retry_thread.daemon = True
    _retry_thread.start()


def _cancel_retry() -> None:
    """Give up handling a signal again."""
    if _HAS_TIMER:
        signal.setitimer(signal.ITIMER_REAL, 0)
    elif _retry_thread is not None:
        _retry_thread.cancel()
