"""What a surface is: its edges, parts, rims and handles.

Triangles of a moving mesh that are turned over or crushed, and its vertices' normals, as quickly as can be.

Windings made to agree: which triangles to turn so that neighbours run along their common side in opposite ways.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from ..kernel import Bools, Floats, Ints, kernel


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


# A triangle with less than this share of its area at rest counts as crushed.
_LEAST = 1e-3

# Two triangles lie back to back where the cosine between their normals is less than minus this.
_BACK = 0.95


class Folds:
    """Looks for triangles that are folded as they were not at rest.

    Parameters
    ----------
    V : float64 [n, 3]
        Vertices at rest [m].
    F : int64 [m, 3]
    """

    def __init__(self, V: Floats, F: Ints) -> None:
        self.F = F
        beside = np.full(F.size, -1)
        pairs = sides_of(F)[0]
        beside[pairs[:, 0]], beside[pairs[:, 1]] = pairs[:, 1] // 3, pairs[:, 0] // 3
        self._beside = beside.reshape(-1, 3)
        normals = _area_vectors(np.asarray(V, np.float64), F)
        self._least = _LEAST * np.linalg.norm(normals, axis=1)
        self._rest = _folded(normals, self._beside, self._least)

    def count(self, V: Floats) -> int:
        """How many triangles are folded back on one that they share a side with, or have next to no area."""
        return int((_folded(_area_vectors(V, self.F), self._beside, self._least) & ~self._rest).sum())

    def vertex_normals(self, V: Floats) -> Floats:
        """Unit normals [n, 3], weighted by the areas of the triangles."""
        return _vertex_normals(_area_vectors(V, self.F), self.F, len(V))


@kernel
def _area_vectors(V: Floats, F: Ints) -> Floats:
    """Normals of triangles, twice as long as their areas, [m, 3]."""
    vectors = np.empty((len(F), 3))
    for i in range(len(F)):
        a, b, c = F[i, 0], F[i, 1], F[i, 2]
        ux, uy, uz = V[b, 0] - V[a, 0], V[b, 1] - V[a, 1], V[b, 2] - V[a, 2]
        vx, vy, vz = V[c, 0] - V[a, 0], V[c, 1] - V[a, 1], V[c, 2] - V[a, 2]
        vectors[i, 0], vectors[i, 1], vectors[i, 2] = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return vectors


@kernel
def _folded(vectors: Floats, beside: Ints, least: Floats) -> Bools:
    """Whether triangles lie flat on one beside them [m, 3], back to back, or are smaller than the least [m]."""
    folded = np.zeros(len(vectors), np.bool_)
    for i in range(len(vectors)):
        x, y, z = vectors[i, 0], vectors[i, 1], vectors[i, 2]
        square = x * x + y * y + z * z
        folded[i] = np.sqrt(square) < least[i]
        for k in range(3):
            j = beside[i, k]
            if j >= 0:
                u, v, w = vectors[j, 0], vectors[j, 1], vectors[j, 2]
                along = x * u + y * v + z * w
                folded[i] |= along < 0 and along * along > _BACK**2 * square * (u * u + v * v + w * w)
    return folded


@kernel
def _vertex_normals(vectors: Floats, F: Ints, count: int) -> Floats:
    """Unit sum of the vectors [m, 3] of the triangles at each vertex; along z where there is none."""
    normals = np.zeros((count, 3))
    for i in range(len(F)):
        for k in range(3):
            for axis in range(3):
                normals[F[i, k], axis] += vectors[i, axis]
    for v in range(count):
        length = np.sqrt(normals[v, 0] ** 2 + normals[v, 1] ** 2 + normals[v, 2] ** 2)
        if length > 0:
            for axis in range(3):
                normals[v, axis] /= length
        else:
            normals[v, 2] = 1.0
    return normals


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
