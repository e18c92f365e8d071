"""What kind of frames a renderer draws."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FrameFormat:
    """Size and kind of a frame.

    Attributes
    ----------
    size : (width, height)
        [pixels].
    samples : int
        Samples a pixel for smooth edges; at most as many as the driver has. 0 or 1: none.
    alpha : bool
        Whether there is an alpha channel: the background is transparent, and only the shadows are left of the floor.
    linear : bool
        Whether colours are linear light in half floats, without tone mapping, in place of sRGB in bytes.
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
        """Of a channel on the GPU, as moderngl names it."""
        return "f2" if self.linear else "f1"
