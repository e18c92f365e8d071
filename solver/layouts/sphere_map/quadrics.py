"""Quadrics: how far a point is from the planes of the triangles round a vertex (Garland and Heckbert 1997)."""

from __future__ import annotations

import numpy as np

from ...kernel import Floats, Ints32, kernel
from .vectors import cross, dot, row, subtract


@kernel
def vertex_quadrics(tail: Ints32, V: Floats) -> Floats:
    """Area-weighted sums of squared plane distances: xx xy xz yy yz zz, x y z, 1 of each vertex, shape [n, 10]."""
    quadrics = np.zeros((len(V), 10))
    for f in range(len(tail) // 3):
        p = row(V, tail[3 * f])
        normal = cross(subtract(row(V, tail[3 * f + 1]), p), subtract(row(V, tail[3 * f + 2]), p))
        twice_area = np.sqrt(dot(normal, normal))
        if twice_area > 0.0:
            x, y, z = normal[0] / twice_area, normal[1] / twice_area, normal[2] / twice_area
            d = -(x * p[0] + y * p[1] + z * p[2])
            terms = (x * x, x * y, x * z, y * y, y * z, z * z, x * d, y * d, z * d, d * d)
            for j in range(3):
                for i in range(10):
                    quadrics[tail[3 * f + j], i] += 0.5 * twice_area * terms[i]
    return quadrics


@kernel
def quadric_error(q: Floats, x: float, y: float, z: float) -> float:
    """Sum of squared distances of (x, y, z) from the planes of a quadric [10]."""
    squares = q[0] * x * x + q[3] * y * y + q[5] * z * z + 2.0 * (q[1] * x * y + q[2] * x * z + q[4] * y * z)
    return squares + 2.0 * (q[6] * x + q[7] * y + q[8] * z) + q[9]
