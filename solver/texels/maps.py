"""Maps: an image in the object's texture coordinates, or values of its vertices, at the texels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SolverError
from ..images import read_image
from .atlas import Atlas

# Places of the channels in an image.
_CHANNELS = {"red": 0, "green": 1, "blue": 2, "alpha": 3}

# Names of channels that a map can be made of.
CHANNELS = ("luminance", *_CHANNELS)


def vertex_map(atlas: Atlas, values: ArrayLike) -> NDArray[np.float64]:
    """Interpolate an attribute of the mesh's vertices linearly to the texels.

    Parameters
    ----------
    atlas : Atlas
    values : [vertex_count] or [vertex_count, k]

    Returns
    -------
    float64 [C, n, n] or [C, n, n, k]

    Raises
    ------
    SolverError
        If there is not one value a vertex.
    """
    values = np.asarray(values, dtype=np.float64)
    if values.ndim not in (1, 2) or len(values) != len(atlas.mesh.V):
        raise SolverError(
            f"vertex values must have shape [{len(atlas.mesh.V)}], one a vertex, got {values.shape}"
        )
    return _interpolate(atlas, values[atlas.mesh.F])


def texture_map(
    atlas: Atlas,
    image: str | Path | ArrayLike,
    low: float = 0.0,
    high: float = 1.0,
    channel: str = "luminance",
) -> NDArray[np.float64]:
    """Sample an image in the object's own texture coordinates, once a texel.

    Parameters
    ----------
    atlas : Atlas
        Of a mesh with texture coordinates.
    image : path, or array [height, width] or [height, width, channels]
        Path of a PNG or any image that Pillow reads, 8 or 16 bits; its values are taken as they
        are, without gamma. Or an array of values from 0 to 1. It repeats beyond its borders; v = 0
        is its lower edge.
    low : float
        What black stands for; in between is linear.
    high : float
        What white stands for.
    channel : str
        One of `CHANNELS`: "luminance" (mean of red, green and blue), "red", "green", "blue" or
        "alpha".

    Returns
    -------
    float64 [C, n, n]
        For any coefficient of `Material`.

    Raises
    ------
    SolverError
        If the mesh has no texture coordinates, the image cannot be read, or it lacks the channel.
    """
    if atlas.mesh.corner_uv is None:
        raise SolverError(
            "the mesh has no texture coordinates for an image; give it some, or use `vertex_map`"
        )
    values = _pixels(image, channel)
    uv = _interpolate(atlas, atlas.mesh.corner_uv)
    height, width = values.shape
    x = uv[..., 0] * width - 0.5
    y = (1 - uv[..., 1]) * height - 0.5
    column = np.floor(x).astype(np.int64)
    row = np.floor(y).astype(np.int64)
    s = x - column
    t = y - row
    left = column % width
    right = (column + 1) % width
    upper_row = row % height
    lower_row = (row + 1) % height
    upper = (1 - s) * values[upper_row, left] + s * values[upper_row, right]
    lower = (1 - s) * values[lower_row, left] + s * values[lower_row, right]
    return low + (high - low) * ((1 - t) * upper + t * lower)


def _interpolate(atlas: Atlas, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values at the texels [C, n, n, ...], from corners of triangles [triangle_count, 3, ...]."""
    return np.einsum("fijk,fijk...->fij...", atlas.barycentrics, corners[atlas.triangles])


def _pixels(image: str | Path | ArrayLike, channel: str) -> NDArray[np.float64]:
    """Values from 0 to 1 of one channel, [height, width]."""
    if isinstance(image, str | Path):
        as_stored = ("L", "LA", "RGB", "RGBA")  # the numbers of a palette are not brightness
        pixels = read_image(
            SolverError,
            image,
            "image",
            lambda mode: mode if mode in as_stored or mode[0] == "I" else "RGBA",
        )
        pixels = pixels / (255.0 if pixels.dtype == np.uint8 else 65535.0)
    else:
        pixels = np.asarray(image, dtype=np.float64)
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    if pixels.ndim != 3 or 0 in pixels.shape or pixels.shape[2] > 4:
        raise SolverError(
            f"image must have shape [height, width] with up to 4 channels, got {pixels.shape}"
        )
    channels = pixels.shape[2]
    if channel == "luminance":
        return pixels[..., : 3 if channels >= 3 else 1].mean(axis=2)
    if channel not in _CHANNELS:
        raise SolverError(
            f"channel must be one of {', '.join(map(repr, CHANNELS))}, got {channel!r}"
        )
    place = channels - 1 if channel == "alpha" and channels in (2, 4) else _CHANNELS[channel]
    if place >= channels:
        raise SolverError(f"the image has no channel {channel!r}, only {channels}; use 'luminance'")
    return pixels[..., place]
