"""Fences: OpenGL's sync objects, which moderngl lacks, to wait for the GPU without blocking other Python threads."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

from ..errors import GLError

_COMMANDS_COMPLETE = 0x9117  # GL_SYNC_GPU_COMMANDS_COMPLETE
_FLUSH = 0x1  # GL_SYNC_FLUSH_COMMANDS_BIT
_TIMEOUT_EXPIRED, _FAILED = 0x911B, 0x911D


class Fences:
    """Creates fences in the current context, and waits for them without holding the interpreter's lock.

    Parameters
    ----------
    address : callable
        Address of an OpenGL function, by its name.
    """

    def __init__(self, address: Callable[[bytes], int]) -> None:
        pointer, number, wide = ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint64
        self._create = ctypes.CFUNCTYPE(pointer, number, number)(address(b"glFenceSync"))
        self._wait = ctypes.CFUNCTYPE(number, pointer, number, wide)(address(b"glClientWaitSync"))
        self._delete = ctypes.CFUNCTYPE(None, pointer)(address(b"glDeleteSync"))

    def put(self) -> int:
        """Put a fence behind all commands so far, and return its handle."""
        return self._create(_COMMANDS_COMPLETE, 0)

    def reached(self, fence: int, patience: float) -> bool:
        """Wait until the driver has finished all commands before the fence, for so long [s] at most.

        A fence that was reached is deleted.

        Raises
        ------
        GLError
            If the driver reports a failure.
        """
        state = _FAILED
        try:
            state = self._wait(fence, _FLUSH, round(1e9 * patience))
        finally:
            if state != _TIMEOUT_EXPIRED:
                self._delete(fence)
        if state == _FAILED:
            raise GLError("OpenGL cannot wait for its own commands; see `ripple-sim info`")
        return state != _TIMEOUT_EXPIRED
