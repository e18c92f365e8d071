"""Read-back: a ring of buffers, so that a frame is copied to memory while later ones are drawn."""

from __future__ import annotations

from collections import deque

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.kernel import kernel

from .frame_format import FrameFormat
from .resources import Resources

_PACKED = 4  # pixels of three bytes that are whole words


class Readback:
    """Frames on their way from the GPU, first in, first out.

    There are as many buffers as frames were ever on their way at a time: pixel buffers of the GPU, or plain memory
    where the driver draws in that itself.

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
        self._free: list[moderngl.Buffer | NDArray] = []
        self._pending: deque[tuple[moderngl.Buffer | NDArray, int]] = deque()

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
            buffer = self._free.pop() if self._free else self._new_buffer()
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
        if isinstance(buffer, np.ndarray):
            pixels = buffer
        else:
            pixels = self._pixels
            with self._gl:
                buffer.read_into(pixels)
        frame = np.empty((*pixels.shape[:2], 4 if self._format.alpha else 3), pixels.dtype)
        _turn(pixels, frame)
        self._free.append(buffer)
        if self._format.linear:
            return frame.view(np.float16)
        if self._format.alpha:
            _unpremultiply(frame)
        return frame

    def _new_buffer(self) -> moderngl.Buffer | NDArray:
        if self._gl.software:
            return np.empty_like(self._pixels)
        return self._resources.buffer(reserve=self._pixels.nbytes, dynamic=True)


def _turn(pixels: NDArray, frame: NDArray) -> None:
    """Copy pixels [height, width, 4], bottom row first, to a frame [height, width, 3 or 4], top row first."""
    width, channels = frame.shape[1:]
    if channels == 3 and width % _PACKED == 0 and frame.dtype == np.uint8:
        words = frame.reshape(len(frame), -1).view(np.uint32)
        return _pack(pixels.view(np.uint32)[::-1, :, 0], words)
    for channel in range(channels):  # all at once would be rows of three numbers, which are slow
        frame[..., channel] = pixels[::-1, :, channel]


@kernel
def _pack(pixels: NDArray[np.uint32], words: NDArray[np.uint32]) -> None:
    """Drop the fourth bytes of pixels [height, width]: every four of them become three words [height, 3 width / 4]."""
    for row in range(pixels.shape[0]):
        for group in range(pixels.shape[1] // _PACKED):
            a, b = pixels[row, 4 * group], pixels[row, 4 * group + 1]
            c, d = pixels[row, 4 * group + 2], pixels[row, 4 * group + 3]
            words[row, 3 * group] = (a & np.uint32(0xFFFFFF)) | (b << np.uint32(24))
            words[row, 3 * group + 1] = ((b >> np.uint32(8)) & np.uint32(0xFFFF)) | (c << np.uint32(16))
            words[row, 3 * group + 2] = ((c >> np.uint32(16)) & np.uint32(0xFF)) | (d << np.uint32(8))


@kernel
def _unpremultiply(frame: NDArray[np.uint8]) -> None:
    """Divide the colours of a frame [height, width, 4] by alpha."""
    for row in range(frame.shape[0]):
        for column in range(frame.shape[1]):
            alpha = np.float32(max(frame[row, column, 3], 1)) / np.float32(255)
            for channel in range(3):
                color = np.float32(frame[row, column, channel]) / alpha + np.float32(0.5)
                frame[row, column, channel] = np.uint8(min(color, np.float32(255)))
