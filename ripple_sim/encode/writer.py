"""`FrameWriter`: frames go in one by one, a video comes out at the end or not at all."""

from __future__ import annotations

from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import EncodingError, SimulationError, VideoError
from ripple_sim.solver.errors import SolverError

from .clip import Stream
from .encoder import Encoder
from .formats import Format
from .part import Part

# Errors that would occur again when the render is resumed.
_HOPELESS = (SimulationError, SolverError)


class FrameWriter:
    """Takes frames, hands them to a thread that encodes them, and moves the finished video to its place.

    Use it as a context manager: leaving it normally closes it, leaving it by an exception ends it. A resumable writer
    then keeps what is finished, unless the same exception would occur again.

    Attributes
    ----------
    frames : int
        Frames written so far, including those of interrupted writers before this one.
    """

    def __init__(
        self, part: Part, video: Format, stream: Stream, shape: tuple[int, int, int], *, resumable: bool
    ) -> None:
        self.path = part.video
        self.frames = part.frames
        self._part, self._shape, self._resumable = part, shape, resumable
        self._type = np.dtype(np.float16 if video.linear else np.uint8)
        self._encoder = Encoder(part, video, stream)

    @property
    def encode_seconds(self) -> float:
        """Time spent encoding [s]; complete after `close`."""
        return self._encoder.seconds

    def write(self, frame: NDArray) -> None:
        """Add one frame, first row on top. It is copied; this waits while the queue is full.

        Parameters
        ----------
        frame : uint8 (sRGB) or for EXR float16 (linear light), [height, width, 3 or 4]

        Raises
        ------
        VideoError
            If the frame's shape or type is another, or the writer is closed.
        EncodingError
            If an earlier frame could not be encoded.
        """
        if not self._encoder.running:
            raise VideoError(f"the video {self.path} is closed; open another writer")
        if frame.shape != self._shape or frame.dtype != self._type:
            raise VideoError(f"frame is {frame.dtype} {list(frame.shape)}; valid is {self._type} {list(self._shape)}")
        self._raise_error()
        self._encoder.put(frame.copy())
        self.frames += 1

    def check_state(self, frame: int, digest: str) -> None:
        """Record the fingerprint, in hexadecimal digits, of a frame's state, or compare it with the recorded one.

        Raises
        ------
        VideoError
            If it differs from the one before the interruption.
        EncodingError
            If it cannot be recorded.
        """
        try:
            self._part.check_state(frame, digest)
        except OSError as error:
            raise EncodingError(f"cannot write the video {self.path}: {error.strerror}") from error

    def close(self) -> None:
        """Finish the video and move it to its place. Repeated calls do nothing.

        Raises
        ------
        VideoError
            If there is no frame.
        EncodingError
            If a frame could not be encoded, or the file not be written.
        """
        if not self._encoder.running:
            return
        if self.frames == 0:
            self.discard()
            raise VideoError(f"the video {self.path} has no frame; write at least one")
        try:
            self._encoder.stop()
            self._raise_error()
        except BaseException as error:  # such as Ctrl-C while the last frames are encoded
            self._give_up(error)
            raise

    def discard(self) -> None:
        """Stop, and remove what was written. A previous video in the same place stays."""
        self._encoder.abandon()
        if not self._encoder.finished:
            self._part.remove()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._give_up(error)

    def _give_up(self, error: BaseException) -> None:
        """End the work on an exception, and add a note of what is kept."""
        if not self._resumable or isinstance(error, _HOPELESS):
            self.discard()
            return
        self._encoder.abandon()
        if not self._encoder.finished and self._part.keep():
            error.add_note(
                f"{self._part.frames} frames are kept in {self._part.folder}; --resume carries on from there"
            )

    def _raise_error(self) -> None:
        error = self._encoder.error
        if error is not None:
            reason = getattr(error, "strerror", None) or error
            raise EncodingError(f"cannot write the video {self.path}: {reason}") from error
