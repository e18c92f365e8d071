"""Windings made to agree: which triangles to turn so that neighbours run along their common side in opposite ways."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra


def labels(pairs: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Connected component of each of `count` nodes, numbered by first occurrence; the links are pairs [k, 2]."""
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), pairs.T), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[inverse]


def turned(
    pairs: NDArray[np.int64], against: NDArray[np.bool_], count: int, cost: NDArray[np.float64] | None = None
) -> NDArray[np.bool_]:
    """Which triangles to turn over, so that as far as possible the windings of linked ones agree.

    Each component follows its first triangle, along a tree of shortest paths. Where a surface is one-sided, links are
    left that disagree: those where paths from both sides meet.

    Parameters
    ----------
    pairs : [k, 2]
        Links of triangles.
    against : bool [k]
        The two have different windings.
    count : int
        Number of triangles.
    cost : [k], optional
        Length of a link; the tree prefers short ones.

    Returns
    -------
    bool [count]
    """
    result = np.zeros(count, dtype=bool)
    if not against.any():
        return result
    length = np.ones(len(pairs)) if cost is None else cost
    # of two triangles with two common sides, one link decides; coo would add both
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    order = np.lexsort((length, high, low))
    key = (low * count + high)[order]
    once = order[np.append(True, key[1:] != key[:-1])]
    graph = coo_array((length[once], (low[once], high[once])), shape=(count, count)).tocsr()
    roots = np.unique(labels(pairs, count), return_index=True)[1]
    _, before, _ = dijkstra(graph, directed=False, indices=roots, return_predecessors=True, min_only=True)
    rest = np.flatnonzero(before >= 0)
    up = np.arange(count)
    up[rest] = before[rest]
    sorted_keys = (low * count + high)[once]
    link = np.searchsorted(sorted_keys, np.minimum(rest, up[rest]) * count + np.maximum(rest, up[rest]))
    result[rest] = against[once][link]
    while (up[up] != up).any():  # the sum along the path, by doubling
        result ^= result[up]
        up = up[up]
    return result
