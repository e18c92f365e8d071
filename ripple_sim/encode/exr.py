"""OpenEXR frames: linear light in half floats, for compositing and grading."""

from __future__ import annotations

import importlib.util
import io
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import VideoError

from .clip import Stream
from .mark import MARK

# ITU-R BT.709: x and y of red, green, blue and white
_CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)


def check_exr() -> None:
    """Make sure that EXR frames can be written.

    Raises
    ------
    VideoError
        If OpenEXR is not installed.
    """
    if importlib.util.find_spec("OpenEXR") is None:
        raise VideoError(
            "EXR frames need OpenEXR, which is not installed; install it with: pip install 'ripple-sim[exr]'"
        )


class Exr:
    """One frame in a file of its own; the same frame gives the same bytes."""

    def __init__(self, path: Path, stream: Stream) -> None:
        self._path, self._rate = path, stream.fps

    def write(self, frame: NDArray[np.float16]) -> None:
        """Write the image, float16 [height, width, 3 or 4], with colours multiplied by opacity."""
        import OpenEXR

        header = {
            "type": OpenEXR.scanlineimage,
            "compression": OpenEXR.ZIP_COMPRESSION,
            "chromaticities": _CHROMATICITIES,
            "software": MARK,
            "framesPerSecond": Fraction(self._rate),
        }
        # through memory: the library does not notice a disk that fills up with the last bytes of a file
        file = io.BytesIO()
        OpenEXR.File(header, {"RGBA"[: frame.shape[2]]: np.ascontiguousarray(frame)}).write(file)
        self._path.write_bytes(file.getbuffer())

    def finish(self) -> None:
        """Do nothing: the image is complete."""

    def close(self) -> None:
        """Do nothing: no file is open."""
