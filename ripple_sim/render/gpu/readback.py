"""Read-back: a ring of pixel buffers, so that a frame is copied to memory while later ones are drawn."""

from __future__ import annotations

from collections import deque

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.render.frame_format import FrameFormat
from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.kernel import kernel

from .resources import Resources


class Readback:
    """Frames on their way from the GPU, first in, first out.

    There are as many buffers as frames were ever on their way at a time.

    Parameters
    ----------
    resources : Resources
    frame_format : FrameFormat
    """

    def __init__(self, resources: Resources, frame_format: FrameFormat) -> None:
        self._gl, self._resources, self._format = resources.gl, resources, frame_format
        width, height = frame_format.size
        # always four channels: drivers copy those as they are, and convert any other number on the processor
        self._pixels = np.empty((height, width, 4), np.uint16 if frame_format.linear else np.uint8)
        self._free: list[moderngl.Buffer] = []
        self._pending: deque[tuple[moderngl.Buffer, int]] = deque()

    def submit(self, frame: moderngl.Framebuffer) -> None:
        """Copy a frame as soon as it is drawn; the next one may be drawn over it.

        Parameters
        ----------
        frame : moderngl.Framebuffer
            RGBA8, or RGBA16F of linear light; bottom row first, multiplied by alpha.
        """
        with self._gl:
            if self._gl.software:  # which would draw the frame in the next call, holding the interpreter's lock
                self._gl.wait()
            size = self._pixels.nbytes
            buffer = self._free.pop() if self._free else self._resources.buffer(reserve=size, dynamic=True)
            frame.read_into(buffer, components=4, alignment=1, dtype=self._format.dtype)
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
        self._gl.wait_for(fence)
        with self._gl:
            buffer.read_into(self._pixels)
        self._free.append(buffer)
        frame = np.empty((*self._pixels.shape[:2], 4 if self._format.alpha else 3), self._pixels.dtype)
        for channel in range(frame.shape[2]):  # all at once would be rows of three numbers, which are slow
            frame[..., channel] = self._pixels[::-1, :, channel]
        if self._format.linear:
            return frame.view(np.float16)
        if self._format.alpha:
            _unpremultiply(frame)
        return frame


@kernel
def _unpremultiply(frame: NDArray[np.uint8]) -> None:
    """Divide the colours of a frame [height, width, 4] by alpha."""
    for row in range(frame.shape[0]):
        for column in range(frame.shape[1]):
            alpha = np.float32(max(frame[row, column, 3], 1)) / np.float32(255)
            for channel in range(3):
                color = np.float32(frame[row, column, channel]) / alpha + np.float32(0.5)
                frame[row, column, channel] = np.uint8(min(color, np.float32(255)))
