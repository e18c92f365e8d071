"""The one context of a device that all in the process share."""

from __future__ import annotations

import threading

from .context import GLContext

_shared: dict[int | None, GLContext] = {}
_selected: int | None = None
_lock = threading.Lock()


def select_device(device: int | None) -> None:
    """Select the EGL device of `shared_context`; None: the first that yields a context."""
    global _selected
    with _lock:
        _selected = device


def shared_context(device: int | None = None) -> GLContext:
    """Return the process-wide context of a device (by default the selected one), created at the first call."""
    with _lock:
        device = _selected if device is None else device
        if device not in _shared:
            _shared[device] = GLContext(device)
        _shared[device].check_process()
        return _shared[device]
