"""What a surface is: its edges, its parts, how its triangles are wound, cut, and folded.

Side k of a triangle runs from corner k to corner k + 1; the sides of all are numbered 3 x triangle
+ k.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra

from ..kernel import Bools, Floats, Ints, kernel

# For each set of cut sides of a triangle (1 for side 0, 2 for side 1, 4 for side 2, added up) the
# triangles that take its place: 0 to 2 are its corners, 3 to 5 the points on its sides.
SPLITS = {
    1: [[0, 3, 2], [3, 1, 2]],
    2: [[1, 4, 0], [4, 2, 0]],
    4: [[2, 5, 1], [5, 0, 1]],
    3: [[3, 1, 4], [0, 3, 4], [0, 4, 2]],
    6: [[4, 2, 5], [1, 4, 5], [1, 5, 0]],
    5: [[5, 0, 3], [2, 5, 3], [2, 3, 1]],
    7: [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
}

# A triangle with less than this share of its area at rest counts as crushed.
_LEAST = 1e-3

# Two triangles lie back to back where the cosine between their normals is less than minus this.
_BACK = 0.95


class Edges(NamedTuple):
    """The edges of triangles.

    Attributes
    ----------
    ends : int64 [e, 2]
        The lower vertex first.
    of : int64 [m, 3]
        Of each triangle, the edges on which its sides lie.
    sides : int64 [e, 2]
        Two sides that lie on each edge; -1 where there is but one.
    """

    ends: Ints
    of: Ints
    sides: Ints

    @property
    def rim(self) -> NDArray[np.bool_]:
        """Mask of the edges with one triangle only, [e]."""
        return self.sides[:, 1] < 0


def edges_of(F: NDArray[np.int64]) -> Edges:
    """Edges of the triangles F [m, 3], sorted by their lower ends, then by the higher."""
    tail = F.ravel()
    head = np.roll(F, -1, axis=1).ravel()
    low = np.minimum(tail, head)
    high = np.maximum(tail, head)
    size = int(F.max()) + 1 if len(F) else 1
    order = counting_sort(low, counting_sort(high, np.arange(len(low)), size)[1], size)[1]
    first = np.ones(len(order), bool)
    first[1:] = (np.diff(low[order]) != 0) | (np.diff(high[order]) != 0)
    of = np.empty(len(order), np.int64)
    of[order] = np.cumsum(first) - 1
    sides = np.full((int(first.sum()), 2), -1)
    sides[:, 0] = order[first]
    sides[of[order[~first]], 1] = order[~first]
    return Edges(np.stack([low[sides[:, 0]], high[sides[:, 0]]], axis=1), of.reshape(-1, 3), sides)


def triangle_areas(V: NDArray[np.float64], F: NDArray[np.integer]) -> NDArray[np.float64]:
    """Areas of triangles, [m], in the square of the unit of the vertices V [n, 3]."""
    a, b, c = (V[F[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def triangle_normals(V: NDArray[np.float64], F: NDArray[np.integer]) -> NDArray[np.float64]:
    """Unit normals of triangles, shape [m, 3]; zero where a triangle has no area."""
    return normalized(np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]]))


def normalized(vectors: NDArray) -> NDArray[np.float64]:
    """Unit vectors of vectors [..., k]; zero stays zero."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1.0)


def corner_angles(V: NDArray[np.float64], F: NDArray[np.integer]) -> NDArray[np.float64]:
    """Angles of triangles at their corners [rad], [m, 3]."""
    corners = V[F]
    angles = np.empty(F.shape)
    for k in range(3):
        a = corners[:, (k + 1) % 3] - corners[:, k]
        b = corners[:, (k + 2) % 3] - corners[:, k]
        angles[:, k] = np.arctan2(
            np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b)
        )
    return angles


def counting_sort(key: Ints, order: Ints, size: int) -> tuple[Ints, Ints]:
    """Sort numbers [k] stably by their keys [k], below `size`: where those of each key begin [size + 1], and all [k].

    SciPy gathers the entries of a sparse matrix by rows in one pass, in the order in which they are
    given.
    """
    count = len(order)
    rows = coo_array((order, (key[order], np.arange(count))), shape=(size, max(count, 1))).tocsr()
    return rows.indptr.astype(np.int64), rows.data


def distinct(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Different values, in ascending order: `numpy.unique`, which on a million integers takes several times as long."""
    ordered = np.sort(values, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])]


def undirected(F: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Number of the edge on which each side lies [3 m], and whether the side ends at the edge's higher vertex [3 m]."""
    a = F.ravel()
    b = np.roll(F, -1, axis=1).ravel()
    return np.minimum(a, b) * (F.max() + 1) + np.maximum(a, b), a < b


def sides_of(F: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sides of a manifold mesh, numbered 3 x triangle + side: pairs that lie together [k, 2], and those on rims [j]."""
    edges = edges_of(F)
    return edges.sides[~edges.rim], np.sort(edges.sides[edges.rim, 0])


def triangles_beside(F: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangle beyond each side of the triangles of a manifold mesh, [m, 3]; -1 at rims."""
    beside = np.full(F.size, -1)
    pairs = sides_of(F)[0]
    beside[pairs] = pairs[:, ::-1] // 3
    return beside.reshape(-1, 3)


class Folds:
    """Looks for triangles F [m, 3] that are folded as they were not at rest, where the vertices are V [n, 3] [m]."""

    def __init__(self, V: Floats, F: Ints) -> None:
        self.F = F
        self._beside = triangles_beside(F)
        normals = _area_vectors(np.asarray(V, np.float64), F)
        self._least = _LEAST * np.linalg.norm(normals, axis=1)
        self._rest = _folded(normals, self._beside, self._least)

    def count(self, V: Floats) -> int:
        """How many triangles are folded back on one that they share a side with, or have next to no area."""
        return int(
            (_folded(_area_vectors(V, self.F), self._beside, self._least) & ~self._rest).sum()
        )

    def vertex_normals(self, V: Floats) -> Floats:
        """Unit normals [n, 3], weighted by the areas of the triangles."""
        return _vertex_normals(_area_vectors(V, self.F), self.F, len(V))


@kernel
def _area_vectors(V: Floats, F: Ints) -> Floats:
    """Normals of triangles, twice as long as their areas, [m, 3]."""
    vectors = np.empty((len(F), 3))
    for i in range(len(F)):
        a = F[i, 0]
        b = F[i, 1]
        c = F[i, 2]
        ux = V[b, 0] - V[a, 0]
        uy = V[b, 1] - V[a, 1]
        uz = V[b, 2] - V[a, 2]
        vx = V[c, 0] - V[a, 0]
        vy = V[c, 1] - V[a, 1]
        vz = V[c, 2] - V[a, 2]
        vectors[i, 0] = uy * vz - uz * vy
        vectors[i, 1] = uz * vx - ux * vz
        vectors[i, 2] = ux * vy - uy * vx
    return vectors


@kernel
def _folded(vectors: Floats, beside: Ints, least: Floats) -> Bools:
    """Whether triangles lie flat on one beside them [m, 3], back to back, or are smaller than the least [m]."""
    folded = np.zeros(len(vectors), np.bool_)
    for i in range(len(vectors)):
        x = vectors[i, 0]
        y = vectors[i, 1]
        z = vectors[i, 2]
        square = x * x + y * y + z * z
        folded[i] = np.sqrt(square) < least[i]
        for k in range(3):
            j = beside[i, k]
            if j >= 0:
                u = vectors[j, 0]
                v = vectors[j, 1]
                w = vectors[j, 2]
                along = x * u + y * v + z * w
                folded[i] |= along < 0 and along * along > _BACK**2 * square * (
                    u * u + v * v + w * w
                )
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
    pairs: NDArray[np.int64],
    against: NDArray[np.bool_],
    count: int,
    cost: NDArray[np.float64] | None = None,
) -> NDArray[np.bool_]:
    """Mask of the triangles to turn over, so that the windings of linked ones agree as far as possible.

    Each component follows its first triangle, along a tree of shortest paths. Where a surface is
    one-sided, links are left that disagree: those where paths from both sides meet.

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
    low = pairs.min(axis=1)
    high = pairs.max(axis=1)
    key = low * count + high
    order = np.lexsort((length, key))
    once = order[np.append(True, np.diff(key[order]) != 0)]
    graph = coo_array((length[once], (low[once], high[once])), shape=(count, count)).tocsr()
    roots = np.unique(labels(pairs, count), return_index=True)[1]
    _, before, _ = dijkstra(
        graph, directed=False, indices=roots, return_predecessors=True, min_only=True
    )
    rest = np.flatnonzero(before >= 0)
    up = np.arange(count)
    up[rest] = before[rest]
    link = np.searchsorted(
        key[once], np.minimum(rest, up[rest]) * count + np.maximum(rest, up[rest])
    )
    result[rest] = against[once][link]
    while (up[up] != up).any():  # the sum along the path, by doubling
        result ^= result[up]
        up = up[up]
    return result
