"""`FrameWriter`: encoding in a thread of its own, so that the renderer does not wait for it."""

from __future__ import annotations

import os
import queue
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import EncodingError, VideoError

from .encoders import Encoder, PngEncoder, mp4_encoder, webm_encoder
from .gif import GifEncoder
from .output import check_output, video_format

# Rendering runs ahead of encoding by at most this many frames; 8 frames of 1280x720 are 22 MB.
QUEUE_FRAMES = 8


def open_writer(path: str | Path, *, width: int, height: int, fps: int) -> FrameWriter:
    """Start a video; the ending of `path` chooses its format.

    `.mp4` is H.264, `.webm` VP9, `.gif` an animated GIF; a name without ending becomes a folder of PNG frames. Missing
    parent folders are created. Nothing appears at `path` before the video is complete; what was there stays until then.

    Parameters
    ----------
    path : str or Path
        Where the video goes.
    width, height : int
        Size of the frames [pixels].
    fps : int
        Frames per second.

    Raises
    ------
    VideoError
        If `check_output` refuses the arguments.
    """
    path = Path(path)
    check_output(path, width, height, fps)
    path.absolute().parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    encoder: Encoder
    match video_format(path):
        case ".mp4":
            encoder = mp4_encoder(unfinished, width, height, fps)
        case ".webm":
            encoder = webm_encoder(unfinished, width, height, fps)
        case ".gif":
            encoder = GifEncoder(unfinished, width, height, fps)
        case _:
            encoder = PngEncoder(unfinished)
    return FrameWriter(encoder, path, width=width, height=height)


class FrameWriter:
    """Takes frames, hands them to an encoder's thread, and moves the finished video to its place.

    Use it as a context manager: leaving it normally closes it, leaving it by an exception discards the video.

    Attributes
    ----------
    frames : int
        Frames written so far.
    encode_seconds : float
        Time the thread has spent encoding [s]; complete after `close`.
    """

    def __init__(self, encoder: Encoder, path: Path, *, width: int, height: int) -> None:
        self.path = path
        self.frames = 0
        self.encode_seconds = 0.0
        self._encoder = encoder
        self._shape = (height, width, 3)
        self._queue: queue.Queue[NDArray[np.uint8] | None] = queue.Queue(QUEUE_FRAMES)
        self._error: Exception | None = None
        self._abandoned = False
        self._thread = threading.Thread(target=self._encode, name="video encoder", daemon=True)
        self._thread.start()

    def write(self, frame: NDArray[np.uint8]) -> None:
        """Add one frame, uint8 [height, width, 3], first row on top. It is copied; this waits where the queue is full.

        Raises
        ------
        VideoError
            If the frame's shape or type is another, or the writer is closed.
        EncodingError
            If an earlier frame could not be encoded.
        """
        if not self._thread.is_alive():
            raise VideoError(f"the video {self.path} is closed; open another writer")
        if frame.shape != self._shape or frame.dtype != np.uint8:
            raise VideoError(f"frame is {frame.dtype} {list(frame.shape)}; valid is uint8 {list(self._shape)}")
        self._raise_error()
        self._queue.put(frame.copy())
        self.frames += 1

    def close(self) -> None:
        """Finish the video and move it to its place. Doing it again does nothing.

        Raises
        ------
        VideoError
            If there is no frame.
        EncodingError
            If a frame could not be encoded, or the file not be written; nothing is left of it then.
        """
        if not self._thread.is_alive():
            return
        if self.frames == 0:
            self.discard()
            raise VideoError(f"the video {self.path} has no frame; write at least one")
        try:
            self._stop()
        except BaseException:  # the user may lose patience while the last frames are encoded
            self.discard()
            raise
        self._raise_error()

    def discard(self) -> None:
        """Stop, and remove what was written. What was at the video's place before stays."""
        self._abandoned = True
        self._stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.discard()

    def _stop(self) -> None:
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()

    def _raise_error(self) -> None:
        if self._error is not None:
            raise EncodingError(f"cannot write the video {self.path}: {self._error}") from self._error

    def _encode(self) -> None:
        while (frame := self._queue.get()) is not None:
            self._timed(self._encoder.write, frame)
        self._timed(self._finish)
        if self._abandoned or self._error is not None:
            self._encoder.discard()

    def _finish(self) -> None:
        self._encoder.finish()
        if self._abandoned:
            return
        if self.path.is_dir():  # of frames and nothing else: `check_output` has looked
            shutil.rmtree(self.path)
        self._encoder.path.replace(self.path)

    def _timed(self, work: Callable[..., None], *arguments: object) -> None:
        """Do the work unless it has become useless, and remember the error instead of ending the thread.

        The thread must go on taking frames from the queue, or `write` would wait for ever.
        """
        if self._abandoned or self._error is not None:
            return
        start = time.perf_counter()
        try:
            work(*arguments)
        except Exception as error:  # whatever it is, it belongs to the caller's thread
            self._error = error
        self.encode_seconds += time.perf_counter() - start
