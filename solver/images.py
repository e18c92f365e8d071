"""Reading of images, with pillow's limit against decompression bombs."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.JpegImagePlugin import JpegImageFile

from .errors import RippleError, shown
from .memory import require_memory

# Memory that a pixel takes while an image is decoded, converted and uploaded [bytes].
_PIXEL_BYTES = 12

# Reductions at which JPEG is decoded.
_JPEG_REDUCTIONS = (2, 4, 8)


def read_image(
    error: type[RippleError],
    source: str | Path | Image.Image,
    what: str,
    mode: Callable[[str], str],
) -> NDArray:
    """Pixels of an image file, or of an image that pillow has opened but perhaps not read.

    Parameters
    ----------
    error : type
        The class of the error that is raised.
    source : path or PIL.Image.Image
    what : str
        What the image is, for messages.
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
        return np.asarray(image.convert(mode(image.mode)))
    except (OSError, ValueError, SyntaxError) as problem:
        raise error(f"{what} {shown(str(source))} cannot be read: {problem}") from problem


def open_image(
    error: type[RippleError], source: str | Path | Image.Image, what: str
) -> Image.Image:
    """The image of a file, as pillow opens it: only its header is read; see `read_image`."""
    name = f"{what} {shown(str(source))}"
    try:
        with warnings.catch_warnings():
            # pillow warns from half of its limit on
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = source if isinstance(source, Image.Image) else _opened(source)
    except Image.DecompressionBombError as bomb:
        raise error(
            f"{name} cannot be read: {bomb} Scale it down, or save it as a JPEG (baseline)"
        ) from bomb
    except (OSError, ValueError, SyntaxError) as problem:
        raise error(f"{name} cannot be read: {problem}") from problem
    width, height = image.size
    require_memory(
        error, _PIXEL_BYTES * width * height, f"{name} of {width}x{height} pixels", "scale it down"
    )
    return image


def _opened(path: str | Path) -> Image.Image:
    """Open an image file; a JPEG beyond pillow's limit is reduced until it is below the limit.

    It is reduced to a half, a quarter or an eighth, while it is decoded row by row. A progressive
    JPEG, or a PNG, would be held in memory as a whole meanwhile, and is not reduced.
    """
    try:
        return Image.open(path)
    except Image.DecompressionBombError as bomb:
        try:
            image = JpegImageFile(path)
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
