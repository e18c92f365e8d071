"""Triangles and vertices in an order in which neighbours come close together.

Drawing then computes a vertex about once and not once for each of its triangles, and heights are predicted well from
earlier ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_Ints = NDArray[np.int64]
_BITS = 10  # of a place along each axis


def local_order(
    points: NDArray, F: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Triangles along Morton's curve through their centres, and vertices in the order of their first use.

    Parameters
    ----------
    points : float, shape [n, 3]
    F : int64, shape [m, 3]

    Returns
    -------
    triangles : int64 [m]
        The old numbers of the triangles, in their new order.
    vertices : int64 [n]
        Likewise those of the vertices; unused ones come last.
    renumbered : int64 [m, 3]
        The triangles in their new order, of new vertices.
    """
    triangles = np.argsort(_morton(points[F].mean(axis=1)), kind="stable")
    used, first = np.unique(F[triangles].ravel(), return_index=True)
    vertices = np.concatenate([used[np.argsort(first)], np.setdiff1d(np.arange(len(points)), used)])
    number = np.empty(len(points), np.int64)
    number[vertices] = np.arange(len(points))
    return triangles, vertices, number[F[triangles]]


def _morton(points: NDArray) -> NDArray[np.int64]:
    """Place of points along the curve: the bits of their coordinates, interleaved."""
    low, size = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-30)
    cells = ((points - low) / size * (2**_BITS - 1)).astype(np.int64)
    bits = cells[:, :, None] >> np.arange(_BITS) & 1
    return (bits << 3 * np.arange(_BITS) + np.arange(3)[:, None]).sum(axis=(1, 2))
