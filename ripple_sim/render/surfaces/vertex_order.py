"""Order of triangles and vertices in memory, for the vertex caches of GPUs and software drivers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .charts import ChartedMesh

_BITS = 10  # of a coordinate


def in_memory_order(mesh: ChartedMesh, position: slice) -> ChartedMesh:
    """The same mesh with neighbours close in memory: its triangles along a Morton curve, its vertices as they use them.

    `position` are the attributes' columns that hold the vertices' positions.
    """
    F = mesh.F[morton_order(mesh.attributes[:, position][mesh.F].mean(axis=1))]
    used, first = np.unique(F, return_index=True)
    vertices = used[np.argsort(first)]
    number = np.empty(len(mesh.attributes), dtype=np.int64)
    number[vertices] = np.arange(len(vertices))
    return ChartedMesh(number[F], mesh.attributes[vertices], mesh.same[vertices], mesh.chart[vertices])


def morton_order(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Order of points [k, 3] along a Morton (Z-order) curve."""
    low, high = points.min(axis=0), points.max(axis=0)
    cell = ((points - low) / max((high - low).max(), 1e-300) * (2**_BITS - 1)).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")
