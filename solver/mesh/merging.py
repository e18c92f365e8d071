"""Equal vertices merged, hairline cracks closed, and triangles dropped that collapse or repeat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .topology import distinct, edges_of

# Relative to the size of the mesh: above the round-off of a file in float32, far below any gap that is meant.
_CRACK = 1e-6
# In widths of a crack: a triangle that is longer does not vanish with it.
_NEEDLE = 10


def merged_vertices(V: NDArray[np.float64], F: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Triangles [m, 3] in which equal positions are one vertex, the first of them; and how many cracks' ends joined."""
    used = distinct(F)
    first = np.arange(len(V))
    # + 0.0 turns -0.0 into 0.0, which are the same place
    first[used] = used[_first_equal(V[used] + 0.0)]
    F = first[F]
    joined = _joined_cracks(V, F)
    return joined, 0 if joined is F else len(distinct(F)) - len(distinct(joined))


def distinct_triangles(F: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which triangles have three different vertices, and are the first that has these three."""
    return ~collapsed(F) & (_first_equal(np.sort(F, axis=1)) == np.arange(len(F)))


def collapsed(F: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which triangles have a vertex twice."""
    return (F[:, 0] == F[:, 1]) | (F[:, 1] == F[:, 2]) | (F[:, 2] == F[:, 0])


def _first_equal(rows: NDArray) -> NDArray[np.int64]:
    """For every row the index of the first row that equals it."""
    order = np.lexsort(rows.T)
    starts = np.ones(len(rows), dtype=bool)
    starts[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    first = np.empty(len(rows), dtype=np.int64)
    first[order] = order[starts][np.cumsum(starts) - 1]
    return first


def _joined_cracks(V: NDArray[np.float64], F: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles with boundary vertices joined that lie within round-off of each other.

    Closed surfaces never change: only boundaries are examined.
    """
    edges, counts = edges_of(F)
    rim = np.unique(edges[(counts == 1) & (edges[:, 0] != edges[:, 1])])
    if len(rim) == 0:
        return F
    width = _CRACK * np.ptp(V[F.ravel()], axis=0).max()
    pairs = cKDTree(V[rim]).query_pairs(width, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(rim), len(rim)))
    _, label = connected_components(graph, directed=False)
    target = np.arange(len(V))
    target[rim] = rim[np.unique(label, return_index=True)[1]][label]
    # a needle is as thin as a crack, but no crack
    lost = collapsed(target[F]) & ~collapsed(F)
    length = np.linalg.norm(V[F[lost]] - V[np.roll(F[lost], 1, axis=1)], axis=-1).max(axis=1)
    needles = np.isin(target, target[F[lost][length > _NEEDLE * width]])
    return np.where(needles, np.arange(len(V)), target)[F]
