"""Heights as few bytes: predicted from earlier vertices and the frame before, and deflated."""

from __future__ import annotations

import base64
import zlib

import numpy as np
from numpy.typing import NDArray

_LARGEST = 1 << 20


def parents_of(F: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Two earlier vertices from which each vertex is predicted, [count, 2]; -1 without.

    They are the other two of the first triangle in which it is the last, or else twice the first of the first triangle
    in which it is the second. decode.js finds the same ones.
    """
    ordered = np.sort(F, axis=1)
    parents = np.full((count, 2), -1)
    vertices, first = np.unique(ordered[:, 1], return_index=True)
    parents[vertices] = ordered[first, :1]
    vertices, first = np.unique(ordered[:, 2], return_index=True)
    parents[vertices] = ordered[first, :2]
    return parents


def quantised(heights: NDArray[np.float32], step: float) -> NDArray[np.int64]:
    """Heights [n] in whole steps [m]."""
    return np.clip(np.rint(heights / step), -_LARGEST, _LARGEST).astype(np.int64)


def residuals(now: NDArray[np.int64], before: NDArray[np.int64], parents: NDArray[np.int64]) -> bytes:
    """What is left of the steps [n] since the frame before after prediction: low bytes of all, then high bytes."""
    change = np.append(now - before, 0)  # -1: no parent, no change
    left = change[:-1] - (change[parents[:, 0]] + change[parents[:, 1]] >> 1)
    zigzag = np.where(left < 0, -2 * left - 1, 2 * left).astype("<u4")
    # the prediction's error may take 23 bits
    return b"".join((zigzag >> shift & 255).astype(np.uint8).tobytes() for shift in (0, 8, 16))


def packed(content: bytes) -> str:
    """Deflated bytes as text."""
    return base64.b64encode(zlib.compress(content, 9)).decode()
