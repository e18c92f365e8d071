"""Ctrl-C, SIGTERM and SIGHUP end a command with one line and status 128 + the signal's number.

Unfinished files are cleaned up.

Before a command begins there is nothing to clean up, and the process ends at once. Later the signal
becomes an exception. Where that would do harm a timer tries again until it is over: within calls of
moderngl's or LLVM's it would end in a segmentation fault; VTK swallows exceptions of what it calls
back, or exits by itself; zarr's threads would go on to write into a folder that is being removed; a
package may take it for an import error; Python swallows it in a finalizer; and a video that is
being opened has nobody yet who would clean it up. A second signal ends the process at once; what is
left is then as whole as after a kill. One that comes after the command, while the interpreter shuts
down, changes nothing.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

_WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated", signal.SIGHUP: "hung up"}
INTERRUPTED, TERMINATED, HUNG_UP = (128 + number for number in _WORDS)

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

_RETRY = 0.02  # [s]


def word_of(status: int) -> str | None:
    """The word for an exit status of a signal, or None for any other."""
    return {128 + number: word for number, word in _WORDS.items()}.get(status)


def end_at_once() -> None:
    """Let the signals end the process at once, with one line.

    A signal that the parent process ignores stays ignored.
    """
    signal.setitimer(signal.ITIMER_REAL, 0)
    _handle(_end)


def end_in_good_order() -> None:
    """Let the signals raise `KeyboardInterrupt` or `SystemExit`.

    A signal that the parent process ignores stays ignored.
    """
    _handle(_raise)


def finish_undisturbed() -> None:
    """Ignore the signals from here on: the command is done, and its status stands.

    While the interpreter shuts down it would give them back to the system, which ends the process
    without a word.
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
    while frame is not None:  # from the innermost of the functions that are running
        name = f"{frame.f_globals.get('__name__', '')}.{frame.f_code.co_qualname}"
        # an exception does harm: try again
        if frame.f_code.co_name == "__del__" or name.startswith(_NEVER_IN):
            signal.signal(signal.SIGALRM, lambda _, then: _raise(number, then))
            signal.setitimer(signal.ITIMER_REAL, _RETRY)
            return
        frame = frame.f_back
    end_at_once()
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    sys.exit(128 + number)
