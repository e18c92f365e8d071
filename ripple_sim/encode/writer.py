"""`open_writer` starts or continues a video.

Frames go in one by one, and the complete video appears at the end or not at all.

`FrameWriter` takes the frames and stores them as segments, in a thread of its own, and joins these.
"""

from __future__ import annotations

import contextlib
import dataclasses
import queue
import threading
import time
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import EncodingError, SimulationError, VideoError
from ripple_sim.solver.errors import SolverError
from ripple_sim.solver.files import final_path

from .clip import Stream
from .formats import FORMATS, Format, Segment, video_format
from .output import check_output
from .part import Part, Settings

# Rendering runs ahead of encoding by at most this many frames; 8 frames of 1280x720 are 22 MB, or
# 44 MB of EXR.
QUEUE_FRAMES = 8


class FrameWriter:
    """Takes frames and writes a video, in a thread of its own.

    The frames are stored as segments of a `Part`, which are joined at the end.

    Use it as a context manager: leaving it normally closes it, leaving it by an exception ends it.
    A resumable writer keeps finished frames, unless the same exception would occur again.

    Attributes
    ----------
    frames : int
        Frames written so far, including those of interrupted writers before this one.
    encode_seconds : float
        Time spent encoding [s]; complete after `close`.
    """

    def __init__(
        self,
        part: Part,
        video: Format,
        stream: Stream,
        shape: tuple[int, int, int],
        *,
        resumable: bool,
    ) -> None:
        self.path = part.video
        self.frames = part.frames
        self.encode_seconds = 0.0
        self._part = part
        self._format = video
        self._stream = stream
        self._shape = shape
        self._resumable = resumable
        self._type = np.dtype(np.float16 if video.linear else np.uint8)
        # heard with the frames, if set before it is closed; see `Stream`
        self.sound: NDArray | None = None
        self._segment: Segment | None = None
        self._pending = 0  # frames of the segment
        # what made encoding fail; frames after that are dropped
        self._error: Exception | None = None
        self._abandoned = False  # whether the video is given up
        self._finished = False  # whether the video is in its place
        self._queue: queue.Queue[NDArray | None] = queue.Queue(QUEUE_FRAMES)
        self._thread = threading.Thread(target=self._run, name="video encoder", daemon=True)
        self._thread.start()

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
        if not self._thread.is_alive():
            raise VideoError(f"the video {self.path} is closed; open another writer")
        if frame.shape != self._shape or frame.dtype != self._type:
            raise VideoError(
                f"frame must be {self._type} {list(self._shape)}, got {frame.dtype} "
                f"{list(frame.shape)}"
            )
        self._raise_error()
        self._queue.put(frame.copy())
        self.frames += 1

    def check_state(self, frame: int, digest: str) -> None:
        """Record the fingerprint of a frame's state, or compare it with the recorded one.

        The fingerprint is a string of hexadecimal digits.

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
        if not self._thread.is_alive():
            return
        if self.frames == 0:
            self.discard()
            raise VideoError(f"the video {self.path} has no frame; write at least one")
        try:
            self._stop()
            self._raise_error()
        except BaseException as error:  # such as Ctrl-C while the last frames are encoded
            self._give_up(error)
            raise

    def discard(self) -> None:
        """Stop, and remove what was written. A previous video in the same place stays."""
        self._abandoned = True
        self._stop()
        if not self._finished:
            self._part.remove()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        if error is None:
            self.close()
        else:
            self._give_up(error)

    def _give_up(self, error: BaseException) -> None:
        """End the work on an exception, and add a note that names the kept files."""
        # these errors would occur again when the render is resumed
        if not self._resumable or isinstance(error, (SimulationError, SolverError)):
            self.discard()
            return
        self._abandoned = True
        self._stop()
        note = "" if self._finished else self._part.keep()
        if note:
            error.add_note(note)

    def _raise_error(self) -> None:
        """Raise what made encoding fail, if anything did."""
        error = self._error
        if error is not None:
            reason = getattr(error, "strerror", None) or error
            raise EncodingError(f"cannot write the video {self.path}: {reason}") from error

    def _stop(self) -> None:
        """Encode the frames in the queue, then end the thread.

        The video is put in its place unless it is given up.
        """
        if self._thread.is_alive():
            self._queue.put(None)
            self._thread.join()

    def _run(self) -> None:
        """Encode the frames of the queue, and after the last, at None, finish the video.

        An error is kept instead of ending the thread: it must keep taking frames from the queue,
        or `write` would wait for ever.
        """
        ended = False
        while not ended:
            frame = self._queue.get()
            ended = frame is None
            if self._abandoned or self._error is not None:  # the work has become useless
                continue
            start = time.perf_counter()
            try:
                self._finish() if frame is None else self._add(frame)
            except Exception as error:  # of any kind: it is raised in the caller's thread
                self._error = error
            self.encode_seconds += time.perf_counter() - start
        if self._segment is not None:
            with contextlib.suppress(Exception):  # the first error has been kept
                self._segment.close()

    def _add(self, frame: NDArray) -> None:
        """Add a frame to its segment, and store the segment if it is complete."""
        if self._segment is None:
            self._segment = self._format.start(self._part.unfinished, self._stream)
        self._segment.write(frame)
        self._pending += 1
        if self._pending == self._format.length:
            self._store()

    def _store(self) -> None:
        """Store the frames of the present segment, if there are any."""
        if self._segment is not None:
            self._segment.finish()
            self._part.store(self._pending)
            self._segment = None
            self._pending = 0

    def _finish(self) -> None:
        """Join the segments, and put the video in its place."""
        self._store()
        if self._format.join is not None:
            stream = dataclasses.replace(self._stream, sound=self.sound)
            self._format.join(self._part.segments, self._part.whole, stream)
        if not self._abandoned:
            self._part.finish()
            self._finished = True


def open_writer(
    path: str | Path,
    *,
    width: int,
    height: int,
    fps: int,
    transparent: bool = False,
    frame_format: str = "png",
    settings: Settings | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> FrameWriter:
    """Start a video, or continue one; the ending of `path` chooses its format.

    `.mp4` is H.264, `.webm` VP9, `.gif` and `.webp` are animated images; a name without ending
    becomes a folder of PNG or EXR frames. Missing parent folders are created. Nothing appears at
    `path` before the video is complete; an earlier file stays until then; one that was not written
    here is replaced only with `overwrite`. A link is written through. Meanwhile the frames are in a
    folder beside it, `path` with `.part` appended, as playable clips or as images. They join to the
    same video, bit for bit, however often the work was interrupted.

    Parameters
    ----------
    path : str or Path
        Where the video goes.
    width, height : int
        Size of the frames [pixels].
    fps : int
        Frames per second.
    transparent : bool
        Frames have a fourth channel, their opacity; colours are multiplied by it for EXR only.
    frame_format : str
        Of a folder's frames, "png" or "exr".
    settings : mapping, optional
        Everything that decides the pixels, by name. With it, finished segments survive an
        interruption.
    resume : bool
        Continue an interrupted writer of the same settings: the next frame to write is number
        `frames`.
    overwrite : bool
        Replace an older file, or older frames, that were not written here.

    Raises
    ------
    VideoError
        If `check_output` refuses the arguments, another process is writing this video, or, with
        `resume`, the interrupted video has other settings.
    EncodingError
        If the folder cannot be written.
    """
    path = Path(path)
    check_output(
        path,
        width,
        height,
        fps,
        transparent=transparent,
        frame_format=frame_format,
        overwrite=overwrite,
    )
    video = FORMATS[video_format(path, frame_format)]
    try:
        part = Part(
            final_path(path),
            video.suffix,
            video.length,
            settings or {},
            resume=resume,
            overwrite=overwrite,
        )
    except OSError as error:
        raise EncodingError(f"cannot write the video {path}: {error.strerror}") from error
    shape = (height, width, 4 if transparent else 3)
    return FrameWriter(
        part, video, Stream(width, height, fps), shape, resumable=settings is not None
    )
