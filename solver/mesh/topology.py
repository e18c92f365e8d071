"""What a surface is: its edges, parts, rims and handles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def edges_of(F: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Edges [edge_count, 2], the lower vertex first, and how many triangles have each."""
    both = np.sort(np.stack([F, np.roll(F, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    base = both.max() + 1
    keys, counts = np.unique(both[:, 0] * base + both[:, 1], return_counts=True)
    return np.stack([keys // base, keys % base], axis=1), counts


def distinct(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Different values, in ascending order: `numpy.unique`, which on a million integers takes several times as long."""
    ordered = np.sort(values, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])]


def undirected(F: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Number of the edge on which each side lies [3 m], and whether the side ends at the edge's higher vertex [3 m]."""
    a, b = F.ravel(), np.roll(F, -1, axis=1).ravel()
    return np.minimum(a, b) * (F.max() + 1) + np.maximum(a, b), a < b


def sides_of(F: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sides of a manifold mesh, numbered 3 x triangle + side: pairs that lie together [k, 2], and those on rims [j]."""
    key, _ = undirected(F)
    order = np.argsort(key, kind="stable")
    second = np.flatnonzero(key[order[1:]] == key[order[:-1]]) + 1
    alone = np.ones(len(key), dtype=bool)
    alone[second], alone[second - 1] = False, False
    return np.stack([order[second - 1], order[second]], axis=1), np.sort(order[alone])


def genera(F: NDArray[np.int64], part: NDArray[np.int64], rims: tuple[NDArray[np.int64], ...]) -> NDArray[np.int64]:
    """Number of handles of every part of a manifold, oriented mesh.

    By Euler's formula V - E + F = 2 - 2 genus - rims.

    Parameters
    ----------
    F : [triangle_count, 3]
    part : [triangle_count]
        Part of every triangle, numbered from 0.
    rims : tuple of [k]
        See `rims_of`.
    """
    count = int(part.max()) + 1
    of_vertex = np.full(F.max() + 1, -1)
    of_vertex[F] = part[:, None]
    vertices = np.bincount(of_vertex[of_vertex >= 0], minlength=count)
    triangles = np.bincount(part)
    # every triangle has three sides; each inner edge has two of them, each edge of a rim one
    on_rims = np.zeros(count, dtype=np.int64)
    loops = np.zeros(count, dtype=np.int64)
    for rim in rims:
        on_rims[of_vertex[rim[0]]] += len(rim)
        loops[of_vertex[rim[0]]] += 1
    edges = (3 * triangles + on_rims) // 2
    return (2 - (vertices - edges + triangles) - loops) // 2


def rims_of(F: NDArray[np.int64]) -> tuple[NDArray[np.int64], ...]:
    """Boundary loops of a manifold, oriented mesh: vertices in the order in which the triangles run along them.

    Each begins at its lowest vertex; they are sorted by it.
    """
    alone = sides_of(F)[1]
    starts, ends = F.ravel()[alone], np.roll(F, -1, axis=1).ravel()[alone]
    following = dict(zip(starts.tolist(), ends.tolist(), strict=True))
    rims = []
    for start in sorted(following):
        rim = []
        while start in following:
            rim.append(start)
            start = following.pop(start)
        if rim:
            rims.append(np.array(rim, dtype=np.int64))
    return tuple(rims)
