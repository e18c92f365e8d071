"""The way back to memory: a ring of pixel buffers, so that a frame comes back while later ones are drawn."""

from __future__ import annotations

from collections import deque

import moderngl
import numba
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.gl import GLContext

from .resources import OwnedObjects


class Readback:
    """Frames on their way from the GPU, first in, first out.

    The ring grows to as many buffers as frames are on their way at a time.

    Parameters
    ----------
    gl : GLContext
    ctx : OwnedObjects
    size : (width, height)
        [pixels].
    alpha : bool
        Whether opacity is kept.
    linear : bool
        Whether frames are linear light: they then come back as they are.
    """

    def __init__(
        self, gl: GLContext, ctx: OwnedObjects, size: tuple[int, int], *, alpha: bool, linear: bool = False
    ) -> None:
        self._gl, self._ctx, self._alpha, self._linear = gl, ctx, alpha, linear
        # always four channels: drivers copy those as they are, and convert any other number on the processor
        self._pixels = np.empty((size[1], size[0], 4), np.uint16 if linear else np.uint8)
        self._free: list[moderngl.Buffer] = []
        self._pending: deque[tuple[moderngl.Buffer, int]] = deque()

    def submit(self, frame: moderngl.Framebuffer) -> None:
        """Have a frame copied as soon as it is drawn; the next one may be drawn over it.

        Parameters
        ----------
        frame : moderngl.Framebuffer
            RGBA8, or RGBA16F of linear light; bottom row first, multiplied by alpha.
        """
        with self._gl:
            if self._gl.software:  # it would draw the frame in the next call, and keep other Python threads waiting
                self._gl.wait()
            buffer = self._free.pop() if self._free else self._ctx.buffer(reserve=self._pixels.nbytes, dynamic=True)
            frame.read_into(buffer, components=4, alignment=1, dtype="f2" if self._linear else "f1")
            self._pending.append((buffer, self._gl.put_fence()))

    def fetch(self) -> NDArray:
        """Wait for the earliest frame that is on its way.

        Returns
        -------
        array, shape [height, width, 3], or [height, width, 4] with alpha
            Top row first; a fresh array for every frame. uint8, alpha straight; or, of linear light, float16,
            multiplied by alpha.

        Raises
        ------
        RippleError
            If none is on its way.
        """
        if not self._pending:
            raise RippleError("no frame is on its way from the GPU; submit one before each that is fetched")
        buffer, fence = self._pending.popleft()
        with self._gl:
            self._gl.wait_for(fence)
            buffer.read_into(self._pixels)
        self._free.append(buffer)
        frame = np.empty((*self._pixels.shape[:2], 4 if self._alpha else 3), self._pixels.dtype)
        _turn(self._pixels, frame)
        if self._linear:
            return frame.view(np.float16)
        if self._alpha:
            _straighten(frame)
        return frame


@numba.njit(cache=True, nogil=True)
def _turn(pixels, frame):
    """Copy as many channels as the frame has, the last row first."""
    height, width, channels = frame.shape
    for row in range(height):
        source, target = pixels[height - 1 - row], frame[row]
        for channel in range(channels):
            for column in range(width):
                target[column, channel] = source[column, channel]


@numba.njit(cache=True, nogil=True)
def _straighten(frame):
    """Divide colours by alpha."""
    for row in range(frame.shape[0]):
        for column in range(frame.shape[1]):
            alpha = np.float32(max(frame[row, column, 3], 1)) / np.float32(255)
            for channel in range(3):
                color = np.float32(frame[row, column, channel]) / alpha + np.float32(0.5)
                frame[row, column, channel] = np.uint8(min(color, np.float32(255)))
