"""EXR files: linear light in half floats, for compositing and grading."""

from __future__ import annotations

import importlib.util
import io
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ripple_sim.errors import VideoError

from .replace import MARK

# ITU-R BT.709: x and y of red, green, blue and white
_BT709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)


def check_exr() -> None:
    """Make sure that EXR frames can be written; raises `VideoError` if OpenEXR is not installed."""
    if importlib.util.find_spec("OpenEXR") is None:
        raise VideoError(
            "EXR frames need OpenEXR, which is not installed; install it with: pip install "
            "'ripple-sim[exr]'"
        )


def write_exr(path: Path, frame: NDArray[np.float16], fps: int) -> None:
    """Write a frame, float16 [height, width, 3 or 4], with colours multiplied by opacity."""
    _write_channels(
        path,
        {"RGBA"[: frame.shape[2]]: frame},
        chromaticities=_BT709,
        framesPerSecond=Fraction(fps),
    )


def _write_channels(path: Path, channels: Mapping[str, NDArray], **attributes: Any) -> None:
    """Write an EXR file; the same content gives the same bytes."""
    import OpenEXR

    header = {
        "type": OpenEXR.scanlineimage,
        "compression": OpenEXR.ZIP_COMPRESSION,
        "software": MARK,
        **attributes,
    }
    # through memory: the library does not notice a disk that fills up with the last bytes of a file
    file = io.BytesIO()
    OpenEXR.File(
        header, {name: np.ascontiguousarray(values) for name, values in channels.items()}
    ).write(file)
    path.write_bytes(file.getbuffer())
