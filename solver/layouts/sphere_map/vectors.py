"""Vectors in space as tuples of three floats, for kernels: they live in registers and read like mathematics."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from ...kernel import Floats, kernel

Vector: TypeAlias = tuple[float, float, float]


@kernel
def row(array: Floats, i: int) -> Vector:
    """Row i of an array of shape [n, 3]."""
    return array[i, 0], array[i, 1], array[i, 2]


@kernel
def set_row(array: Floats, i: int, a: Vector) -> None:
    """Write a into row i of an array of shape [n, 3]."""
    array[i, 0] = a[0]
    array[i, 1] = a[1]
    array[i, 2] = a[2]


@kernel
def subtract(a: Vector, b: Vector) -> Vector:
    """Difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def combine(s: float, a: Vector, t: float, b: Vector) -> Vector:
    """Linear combination s a + t b."""
    return s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def unit(a: Vector) -> Vector:
    """Return a scaled to length 1; a vector of length 0 stays as it is."""
    length = np.sqrt(dot(a, a))
    s = 1.0 / length if length > 0.0 else 1.0
    return s * a[0], s * a[1], s * a[2]


@kernel
def tangent_frame(p: Vector) -> tuple[Vector, Vector]:
    """Two orthonormal tangents x, y of the unit sphere at p, with x, y, p right-handed."""
    x = unit((0.0, p[2], -p[1])) if abs(p[0]) < 0.6 else unit((-p[2], 0.0, p[0]))
    return x, cross(p, x)
