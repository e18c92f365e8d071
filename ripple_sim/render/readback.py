"""The format of frames, and how they are read back from the GPU."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.errors import RippleError
from ripple_sim.solver.kernel import kernel

from .resources import Resources


@dataclass(frozen=True)
class FrameFormat:
    """Size and kind of a frame.

    Attributes
    ----------
    size : (width, height)
        Width and height [pixels].
    samples : int
        Samples a pixel for smooth edges; at most as many as the driver has. With 0 or 1 edges are
        not smoothed.
    alpha : bool
        Whether there is an alpha channel: the background is transparent, and only the shadows are
        left of the floor.
    linear : bool
        Whether colours are linear light in half floats, without tone mapping, in place of sRGB in
        bytes.
    """

    size: tuple[int, int]
    samples: int = 4
    alpha: bool = False
    linear: bool = False

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.size[0] / self.size[1]

    @property
    def dtype(self) -> str:
        """Type of a channel on the GPU, as moderngl names it."""
        return "f2" if self.linear else "f1"


class Readback:
    """Frames on their way from the GPU, first in, first out.

    There are as many buffers as there were frames on their way at the same time. They are pixel
    buffers of the GPU, or plain memory for a software driver.
    """

    def __init__(self, resources: Resources, frame_format: FrameFormat) -> None:
        self._gl = resources.gl
        self._resources = resources
        self._format = frame_format
        width, height = frame_format.size
        # Four channels in any case: drivers copy them unchanged, and convert any other number of
        # channels on the processor.
        self._pixels = np.empty((height, width, 4), np.uint16 if frame_format.linear else np.uint8)
        self._free: list[moderngl.Buffer | NDArray] = []
        self._pending: deque[tuple[moderngl.Buffer | NDArray, int]] = deque()

    def submit(self, frame: moderngl.Framebuffer) -> None:
        """Copy a frame as soon as it is drawn; the next frame may then overwrite it.

        Parameters
        ----------
        frame : moderngl.Framebuffer
            RGBA8, or RGBA16F of linear light; bottom row first, multiplied by alpha.
        """
        with self._gl:
            # a software driver draws in the next call otherwise, and holds the interpreter's lock
            if self._gl.software:
                self._gl.wait()
            if self._free:
                buffer = self._free.pop()
            elif self._gl.software:
                buffer = np.empty_like(self._pixels)
            else:
                buffer = self._resources.buffer(reserve=self._pixels.nbytes, dynamic=True)
            frame.read_into(buffer, components=4, alignment=1, dtype=self._format.dtype)
            self._pending.append((buffer, self._gl.put_fence()))

    def fetch(self) -> NDArray:
        """Wait for the earliest frame on its way, and return its pixels.

        Returns
        -------
        array, shape [height, width, 3], or [height, width, 4] with alpha
            Top row first; a new array for every frame. sRGB frames are uint8, not multiplied by
            alpha. Linear frames are float16, multiplied by alpha.

        Raises
        ------
        RippleError
            If no frame is on its way.
        """
        if not self._pending:
            raise RippleError(
                "no frame is on its way from the GPU; submit one before each that is fetched"
            )
        buffer, fence = self._pending.popleft()
        self._gl.wait_for(fence)
        if isinstance(buffer, np.ndarray):
            pixels = buffer
        else:
            pixels = self._pixels
            with self._gl:
                buffer.read_into(pixels)
        frame = np.empty((*pixels.shape[:2], 4 if self._format.alpha else 3), pixels.dtype)
        # channel by channel: copying rows of three numbers at once is slower
        for channel in range(frame.shape[2]):
            frame[..., channel] = pixels[::-1, :, channel]
        self._free.append(buffer)
        if self._format.linear:
            return frame.view(np.float16)
        if self._format.alpha:
            _unpremultiply(frame)
        return frame

    def forget(self) -> None:
        """Discard all frames on their way."""
        while self._pending:
            buffer, fence = self._pending.popleft()
            self._gl.wait_for(fence)
            self._free.append(buffer)


@kernel
def _unpremultiply(frame: NDArray[np.uint8]) -> None:
    """Divide the colours of a frame [height, width, 4] by alpha."""
    for row in range(frame.shape[0]):
        for column in range(frame.shape[1]):
            alpha = np.float32(max(frame[row, column, 3], 1)) / np.float32(255)
            for channel in range(3):
                color = np.float32(frame[row, column, channel]) / alpha + np.float32(0.5)
                frame[row, column, channel] = np.uint8(min(color, np.float32(255)))
