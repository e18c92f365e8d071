"""How a page's numbers are coded: quantised, predicted from numbers before, and deflated.

decode.js reads what is written here.
"""

from __future__ import annotations

import base64
import zlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_MAX_STEPS = 1 << 20  # of a quantised height or coordinate

# The greatest number of a scaled half-precision field: numbers down to a 4e-10th of it keep all
# their digits.
_HALF_PRECISION_MAX = 32768.0


class ScaledField(NamedTuple):
    """A field for a page: one number, or half-precision numbers times a scale.

    Attributes
    ----------
    meta : float or dict
        The number, or {"scale": s}.
    content : bytes
        The field's planes of bytes; none for a number.
    """

    meta: float | dict[str, float]
    content: bytes


def scaled_field(values: NDArray) -> ScaledField:
    """Code a field with a relative error of at most 2^-11."""
    flat = np.asarray(values, np.float64).ravel()
    if (flat == flat[0]).all():
        return ScaledField(float(flat[0]), b"")
    scale = float(np.abs(flat).max()) / _HALF_PRECISION_MAX
    return ScaledField({"scale": scale}, planes((flat / scale).astype("<f2")))


def planes(values: NDArray) -> bytes:
    """The low bytes of all numbers, then the higher bytes: alike bytes lie together."""
    size = values.dtype.itemsize
    return np.ascontiguousarray(values).view(np.uint8).reshape(-1, size).T.tobytes()


def differences(values: NDArray[np.int64]) -> NDArray[np.uint16]:
    """Differences of numbers below 65,536 from the number before, along the first axis."""
    return np.diff(values, axis=0, prepend=np.zeros_like(values[:1])).astype("<u2")


def parents_of(F: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Two earlier vertices from which each vertex is predicted, [count, 2]; -1 without.

    They are the other two of the first triangle in which it is the last, or else twice the first of
    the first triangle in which it is the second. decode.js finds the same ones.
    """
    ordered = np.sort(F, axis=1)
    parents = np.full((count, 2), -1)
    for column in (1, 2):
        vertices, first = np.unique(ordered[:, column], return_index=True)
        parents[vertices] = ordered[first, :column]
    return parents


def quantised(heights: NDArray[np.float32], step: float) -> NDArray[np.int64]:
    """Heights [n] in whole steps [m]."""
    return np.clip(np.rint(heights / step), -_MAX_STEPS, _MAX_STEPS).astype(np.int64)


def residuals(
    now: NDArray[np.int64], before: NDArray[np.int64], parents: NDArray[np.int64]
) -> bytes:
    """Errors of the prediction of steps [n] from the frame before and from the parents.

    The low bytes of all come first, then the higher bytes.
    """
    change = np.append(now - before, 0)  # the last entry: no parent, no change
    predicted = change[parents[:, 0]] + change[parents[:, 1]] >> 1
    error = change[:-1] - predicted
    zigzag = np.where(error < 0, -2 * error - 1, 2 * error).astype("<u4")
    # the prediction's error may take 23 bits
    return b"".join((zigzag >> shift & 255).astype(np.uint8).tobytes() for shift in (0, 8, 16))


def packed(content: bytes) -> str:
    """Deflated bytes as text."""
    return base64.b64encode(zlib.compress(content, 9)).decode()
