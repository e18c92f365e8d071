"""Ctrl-C and SIGTERM as exceptions, so that unfinished work is cleaned up.

Before a command begins, and during imports, where an exception could be taken for an import error, there is nothing to
clean up, and the process ends at once.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

INTERRUPTED, TERMINATED = 130, 143
_STATUS = {signal.SIGINT: (INTERRUPTED, "interrupted"), signal.SIGTERM: (TERMINATED, "terminated")}


def end_at_once() -> None:
    """Let both signals end the process, with one line; a signal ignored by the parent stays ignored."""
    _handle(_end)


def end_in_good_order() -> None:
    """Let both signals raise `KeyboardInterrupt` or `SystemExit`; a signal ignored by the parent stays ignored."""
    _handle(_raise)


def _handle(handler: Callable[[int, FrameType | None], None]) -> None:
    for number in _STATUS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _end(number: int, frame: FrameType | None) -> None:
    status, word = _STATUS[signal.Signals(number)]
    os.write(2, f"ripple-sim: {word}\n".encode())
    os._exit(status)


def _raise(number: int, frame: FrameType | None) -> None:
    if _importing(frame):
        _end(number, frame)
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    sys.exit(TERMINATED)


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False
