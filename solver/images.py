"""Reading of images, with pillow's limit against decompression bombs."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from PIL.JpegImagePlugin import JpegImageFile

from .errors import RippleError, shown
from .memory import require_memory

# Memory that a pixel takes while an image is decoded, converted and uploaded [bytes].
_PIXEL_BYTES = 12

# Modes of pillow whose channels are larger than bytes, and modes that may be wanted instead.
_NUMBER_MODES = ("I;16", "I;16B", "I;16L", "I", "F")
_BYTE_MODES = ("L", "RGB", "RGBA")

# The greatest number of 16 bits.
_MAX_UINT16 = 2**16 - 1

# Reductions at which JPEG is decoded.
_JPEG_REDUCTIONS = (2, 4, 8)


def read_image(
    error: type[RippleError],
    source: str | Path | bytes | Image.Image,
    what: str,
    mode: Callable[[str], str],
) -> NDArray:
    """Pixels of an image file, or of an image that pillow has opened but perhaps not read.

    Numbers of 16 or 32 bits are scaled to bytes where the wanted mode has bytes.

    Parameters
    ----------
    error : type
        The class of the error that is raised.
    source : path, bytes or PIL.Image.Image
        The file, or its content.
    what : str
        What the image is, for messages; with its name, if the source is bytes.
    mode : callable
        Gives the wanted mode for the file's mode, as pillow names modes.

    Returns
    -------
    array [height, width] or [height, width, channels], top row first

    Raises
    ------
    RippleError
        If the file cannot be read, has more pixels than pillow allows, or its pixels do not fit
        into memory.
    """
    image = open_image(error, source, what)
    try:
        wanted = mode(image.mode)
        if wanted in _BYTE_MODES and image.mode in _NUMBER_MODES:
            image = _of_bytes(image)
        return np.asarray(image.convert(wanted))
    except (OSError, ValueError, SyntaxError) as problem:
        raise error(f"{_name(source, what)} cannot be read: {problem}") from problem


def _name(source: str | Path | bytes | Image.Image, what: str) -> str:
    return what if isinstance(source, bytes) else f"{what} {shown(str(source))}"


def _of_bytes(image: Image.Image) -> Image.Image:
    """A grey image of bytes from one of larger numbers.

    Integers are 0 to 65535. Floats are 0 to 1, or from their least to their greatest where one of
    them is beyond.
    """
    numbers = np.nan_to_num(np.asarray(image, dtype=np.float64))
    low = 0.0
    high = float(_MAX_UINT16)
    if image.mode == "F":
        low = min(float(numbers.min(initial=0.0)), 0.0)
        high = max(float(numbers.max(initial=0.0)), 1.0)
    scaled = np.clip((numbers - low) / (high - low), 0.0, 1.0)
    return Image.fromarray(np.rint(255 * scaled).astype(np.uint8))


def open_image(
    error: type[RippleError], source: str | Path | bytes | Image.Image, what: str
) -> Image.Image:
    """The image of a file, as pillow opens it: only its header is read; see `read_image`."""
    name = _name(source, what)
    try:
        with warnings.catch_warnings():
            # pillow warns from half of its limit on
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = source if isinstance(source, Image.Image) else _opened(source)
    except Image.DecompressionBombError as bomb:
        raise error(
            f"{name} cannot be read: {bomb} Scale it down, or save it as a JPEG (baseline)"
        ) from bomb
    except UnidentifiedImageError as problem:  # pillow's message repeats the file's name
        raise error(f"{name} cannot be read: it is damaged, or in an unknown format") from problem
    except (OSError, ValueError, SyntaxError) as problem:
        raise error(f"{name} cannot be read: {problem}") from problem
    width, height = image.size
    require_memory(
        error, _PIXEL_BYTES * width * height, f"{name} of {width}x{height} pixels", "scale it down"
    )
    return image


def _opened(path: str | Path | bytes) -> Image.Image:
    """Open an image file; a JPEG beyond pillow's limit is reduced until it is below the limit.

    It is reduced to a half, a quarter or an eighth, while it is decoded row by row. A progressive
    JPEG, or a PNG, would be held in memory as a whole meanwhile, and is not reduced.
    """
    content = io.BytesIO(path) if isinstance(path, bytes) else path
    try:
        return Image.open(content)
    except Image.DecompressionBombError as bomb:
        try:
            image = JpegImageFile(io.BytesIO(path) if isinstance(path, bytes) else path)
        except SyntaxError:  # the file is not a JPEG
            raise bomb from None
        width, height = image.size
        allowed = 2 * (Image.MAX_IMAGE_PIXELS or 0)
        scales = [k for k in _JPEG_REDUCTIONS if width * height <= k * k * allowed]
        if not scales or image.info.get("progressive"):
            image.close()
            raise
        image.draft(None, (width // scales[0], height // scales[0]))
        return image
