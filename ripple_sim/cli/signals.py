"""Ctrl-C and SIGTERM: exceptions, so that what is unfinished is cleared away on the way out.

While a module is being imported an exception would come out of it as any other error, with a traceback; but nothing has
begun then that needs clearing away, so the process ends at once.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

INTERRUPTED, TERMINATED = 130, 143
_STATUS = {signal.SIGINT: (INTERRUPTED, "interrupted"), signal.SIGTERM: (TERMINATED, "terminated")}


def handle_signals() -> None:
    """Let both signals end the program in good order; one that the caller had ignored stays ignored."""
    for number in _STATUS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end)


def _end(number: int, frame: FrameType | None) -> None:
    status, word = _STATUS[signal.Signals(number)]
    if _importing(frame):
        os.write(2, f"ripple-sim: {word}\n".encode())
        os._exit(status)
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    sys.exit(status)


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False
