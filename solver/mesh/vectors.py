"""Vectors in space as three coordinates: of a single point in a kernel, or whole columns.

In a kernel the three numbers live in registers.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from ..kernel import Floats, shared

# Three floats, or three arrays of one shape: x, y and z.
Vector: TypeAlias = Any


@shared
def row(array: Floats, i: int) -> Vector:
    """Row i of an array of shape [n, 3]."""
    return array[i, 0], array[i, 1], array[i, 2]


@shared
def subtract(a: Vector, b: Vector) -> Vector:
    """Difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@shared
def combine(s: float, a: Vector, t: float, b: Vector) -> Vector:
    """Linear combination s a + t b."""
    return s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]


@shared
def dot(a: Vector, b: Vector) -> Any:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@shared
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@shared
def unit(a: Vector) -> Vector:
    """Return the vector a scaled to length 1; a single vector of length 0 stays as it is."""
    length = np.sqrt(dot(a, a))
    s = 1.0 / length if length > 0.0 else 1.0
    return s * a[0], s * a[1], s * a[2]
