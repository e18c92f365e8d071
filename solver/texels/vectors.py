"""Vectors of three coordinates, of one point or of many, in kernels and in NumPy."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from ..kernel import shared

Numbers: TypeAlias = Any  # a float, or an array of them
Points: TypeAlias = Any  # coordinates [3] of a point, or [3, ...] of many


@shared
def or_one(x: Numbers) -> Numbers:
    """1 in place of 0: what is divided by it is 0 as well."""
    return x + (x == 0)


@shared
def dot(a: Points, b: Points) -> Numbers:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@shared
def cross_length(a: Points, b: Points) -> Numbers:
    """Length of the vector product."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return np.sqrt(x * x + y * y + z * z)


@shared
def between(a: Points, b: Points) -> Points:
    """Difference b - a."""
    return (b[0] - a[0], b[1] - a[1], b[2] - a[2])
