"""`Recorder`: screenshots and recordings of the viewer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ripple_sim.encode import FrameWriter, open_writer
from ripple_sim.errors import VideoError
from ripple_sim.solver.files import atomic_write


class Recorder:
    """Writes screenshots, and one video at a time, to a folder.

    Files are called name-1.png, name-1.mp4 and so on.
    """

    def __init__(self, folder: Path, name: str, fps: int) -> None:
        self.folder = folder
        self._name = name
        self._fps = fps
        self._writer: FrameWriter | None = None

    @property
    def recording(self) -> bool:
        """Whether a video is being written."""
        return self._writer is not None

    def save(self, frame: NDArray[np.uint8]) -> Path:
        """Write a frame to an image, uint8 [height, width, 3], and return its path.

        Raises `VideoError` if it cannot be written.
        """
        path = self.free_path(".png")
        try:
            with atomic_write(path) as unfinished:
                Image.fromarray(frame).save(unfinished, format="PNG")
        except OSError as error:
            raise VideoError(f"cannot write {path}: {error.strerror or error}") from error
        return path

    def start(self, frame: NDArray[np.uint8]) -> Path:
        """Begin a video of frames of this size; an odd row or column is left out. Return its path.

        Raises `VideoError` if it cannot be written.
        """
        height, width, _ = _even(frame).shape
        path = self.free_path(".mp4")
        self._writer = open_writer(path, width=width, height=height, fps=self._fps)
        self._shape = height, width, 3
        return path

    def add(self, frame: NDArray[np.uint8]) -> bool:
        """Add a frame, or end the video if the window has changed its size.

        Return whether the run continues.

        Raises
        ------
        EncodingError
            If it cannot be written; the video has then ended.
        """
        frame = _even(frame)
        if self._writer is None or frame.shape != self._shape:
            self.stop()
            return False
        try:
            self._writer.write(frame)
        except BaseException:
            self._writer.discard()
            self._writer = None
            raise
        return True

    def stop(self) -> Path | None:
        """End the video; return its path if one was being written."""
        writer = self._writer
        self._writer = None
        if writer is None:
            return None
        if writer.frames:
            writer.close()
            return writer.path
        writer.discard()
        return None

    def free_path(self, ending: str) -> Path:
        """Path of a new file with an ending."""
        number = 1
        path = self._numbered_path(number, ending)
        while path.exists():
            number += 1
            path = self._numbered_path(number, ending)
        return path

    def _numbered_path(self, number: int, ending: str) -> Path:
        return self.folder / f"{self._name}-{number}{ending}"


def _even(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width, _ = frame.shape
    return np.ascontiguousarray(frame[: height - height % 2, : width - width % 2])
