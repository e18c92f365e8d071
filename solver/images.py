"""Images to be read, with pillow's limit against decompression bombs."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.JpegImagePlugin import JpegImageFile

try:
    import resource
except ImportError:  # on Windows
    resource = None  # type: ignore[assignment]

from .errors import RippleError, shown
from .memory import require_memory

# Of a pixel while an image is decoded, converted and uploaded [bytes].
_PIXEL = 12


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
        What is raised.
    source : path or PIL.Image.Image
    what : str
        What the image is, for messages.
    mode : callable
        From the file's mode, as pillow names it, to the one that is wanted.

    Returns
    -------
    array [height, width] or [height, width, channels], top row first

    Raises
    ------
    RippleError
        If the file cannot be read, has more pixels than pillow allows, or these do not fit into
        memory.
    """
    image = open_image(error, source, what)
    try:
        return np.asarray(image.convert(mode(image.mode)))
    except (OSError, ValueError, SyntaxError) as problem:
        raise error(f"{what} {shown(str(source))} cannot be read: {problem}") from problem


def open_image(
    error: type[RippleError], source: str | Path | Image.Image, what: str
) -> Image.Image:
    """The image of a file, as pillow opens it: nothing but its head is read; see `read_image`."""
    name = f"{what} {shown(str(source))}"
    try:
        with warnings.catch_warnings():
            # that half of the limit is reached
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
        error, _PIXEL * width * height, f"{name} of {width}x{height} pixels", "scale it down"
    )
    return image


def _opened(path: str | Path) -> Image.Image:
    """An image file; a JPEG beyond pillow's limit at the half, quarter or eighth of its size at which it is below.

    It is decoded at that size, row by row. A progressive one, or a PNG, would be held whole
    meanwhile.
    """
    try:
        return Image.open(path)
    except Image.DecompressionBombError as bomb:
        try:
            image = JpegImageFile(path)
        except SyntaxError:  # it is no JPEG
            raise bomb from None
        width, height = image.size
        scales = [
            k for k in (2, 4, 8) if width * height <= k * k * 2 * (Image.MAX_IMAGE_PIXELS or 0)
        ]
        if not scales or image.info.get("progressive"):
            image.close()
            raise
        image.draft(None, (width // scales[0], height // scales[0]))
        return image
