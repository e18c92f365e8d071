"""`Encoder`: frames encoded into segments, in a thread of its own, and joined to the video."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable

from numpy.typing import NDArray

from .clip import Stream
from .formats import Format, Segment
from .part import Part

# Rendering runs ahead of encoding by at most this many frames; 8 frames of 1280x720 are 22 MB, or 44 MB of EXR.
QUEUE_FRAMES = 8


class Encoder:
    """A thread that takes frames, stores them as segments of a `Part`, and finally joins these.

    Parameters
    ----------
    part : Part
    video : Format
    stream : Stream

    Attributes
    ----------
    error : Exception or None
        What made encoding fail. Frames after that are dropped.
    seconds : float
        Time spent encoding [s]; complete after `stop`.
    finished : bool
        Whether the video is in its place.
    """

    def __init__(self, part: Part, video: Format, stream: Stream) -> None:
        self._part, self._format, self._stream = part, video, stream
        self._segment: Segment | None = None
        self._pending = 0
        self._queue: queue.Queue[NDArray | None] = queue.Queue(QUEUE_FRAMES)
        self._abandoned = False
        self.error: Exception | None = None
        self.seconds = 0.0
        self.finished = False
        self._thread = threading.Thread(target=self._run, name="video encoder", daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether it still takes frames."""
        return self._thread.is_alive()

    def put(self, frame: NDArray) -> None:
        """Add a frame, which must stay as it is; waits while the queue is full."""
        self._queue.put(frame)

    def stop(self) -> None:
        """Encode what is in the queue, put the video in its place, and end the thread."""
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()

    def abandon(self) -> None:
        """End the thread without finishing the video."""
        self._abandoned = True
        self.stop()

    def _run(self) -> None:
        while (frame := self._queue.get()) is not None:
            self._timed(self._add, frame)
        self._timed(self._finish)
        if self._segment is not None:
            with contextlib.suppress(Exception):  # the first error has been kept
                self._segment.close()

    def _add(self, frame: NDArray) -> None:
        if self._segment is None:
            self._segment = self._format.start(self._part.unfinished, self._stream)
        self._segment.write(frame)
        self._pending += 1
        if self._pending == self._format.length:
            self._store()

    def _store(self) -> None:
        if self._segment is not None:
            self._segment.finish()
            self._part.store(self._pending)
            self._segment, self._pending = None, 0

    def _finish(self) -> None:
        self._store()
        if self._format.join is not None:
            self._format.join(self._part.segments(), self._part.whole, self._stream)
        if not self._abandoned:
            self._part.finish()
            self.finished = True

    def _timed(self, work: Callable[..., None], *arguments: object) -> None:
        """Do the work unless it has become useless, and keep an error instead of ending the thread.

        The thread must go on taking frames from the queue, or `put` would wait for ever.
        """
        if self._abandoned or self.error is not None:
            return
        start = time.perf_counter()
        try:
            work(*arguments)
        except Exception as error:  # of any kind: it is raised in the caller's thread
            self.error = error
        self.seconds += time.perf_counter() - start
