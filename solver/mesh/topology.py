"""Topology of triangle surfaces: edges, parts, windings, cuts and folds.

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
_MIN_AREA_SHARE = 1e-3

# Two triangles lie back to back if the cosine between their normals is less than minus this.
_BACK_TO_BACK_COSINE = 0.95


class Edges(NamedTuple):
    """The edges of triangles.

    Attributes
    ----------
    ends : int64 [e, 2]
        The lower vertex first.
    of_side : int64 [m, 3]
        The edge on which each side of each triangle lies.
    sides : int64 [e, 2]
        The two sides that lie on each edge; -1 in the place of a second one at a rim.
    """

    ends: Ints
    of_side: Ints
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
    vertex_count = int(F.max()) + 1 if len(F) else 1
    by_high = counting_sort(high, np.arange(len(low)), vertex_count)[1]
    order = counting_sort(low, by_high, vertex_count)[1]
    is_first = np.ones(len(order), bool)
    is_first[1:] = (np.diff(low[order]) != 0) | (np.diff(high[order]) != 0)
    edge_of_side = np.empty(len(order), np.int64)
    edge_of_side[order] = np.cumsum(is_first) - 1
    first_sides = order[is_first]
    second_sides = order[~is_first]
    sides = np.full((len(first_sides), 2), -1)
    sides[:, 0] = first_sides
    sides[edge_of_side[second_sides], 1] = second_sides
    ends = np.stack([low[first_sides], high[first_sides]], axis=1)
    return Edges(ends, edge_of_side.reshape(-1, 3), sides)


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
    """Sort numbers [k] stably by their keys [k], which are below `size`.

    Returns where the numbers of each key begin [size + 1], and the sorted numbers [k].

    SciPy gathers the entries of a sparse matrix by rows in one pass, in the order in which they are
    given.
    """
    count = len(order)
    rows = coo_array((order, (key[order], np.arange(count))), shape=(size, max(count, 1))).tocsr()
    return rows.indptr.astype(np.int64), rows.data


def distinct(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Different values, in ascending order.

    `numpy.unique` takes several times as long on a million integers.
    """
    ordered = np.sort(values, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])]


def undirected(F: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Number of each side's edge [3 m], and whether the side runs to the higher vertex [3 m].

    The number is (lower vertex) x (number of vertices) + (higher vertex).
    """
    a = F.ravel()
    b = np.roll(F, -1, axis=1).ravel()
    vertex_count = F.max() + 1
    edge = np.minimum(a, b) * vertex_count + np.maximum(a, b)
    return edge, a < b


def sides_of(F: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sides of a manifold mesh: pairs on one edge [k, 2], and single sides on rims [j].

    Sides are numbered 3 x triangle + side.
    """
    edges = edges_of(F)
    return edges.sides[~edges.rim], np.sort(edges.sides[edges.rim, 0])


def triangles_beside(F: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangle beyond each side of the triangles of a manifold mesh, [m, 3]; -1 at rims."""
    beside = np.full(F.size, -1)
    pairs = sides_of(F)[0]
    beside[pairs] = pairs[:, ::-1] // 3
    return beside.reshape(-1, 3)


class Folds:
    """Looks for triangles F [m, 3] that are folded now, but were not at rest.

    `V` [n, 3] are the vertices at rest [m].
    """

    def __init__(self, V: Floats, F: Ints) -> None:
        self.F = F
        self._beside = triangles_beside(F)
        normals = _area_vectors(np.asarray(V, np.float64), F)
        self._least_double_areas = _MIN_AREA_SHARE * np.linalg.norm(normals, axis=1)
        self._folded_at_rest = _folded(normals, self._beside, self._least_double_areas)

    def count(self, V: Floats) -> int:
        """Number of triangles that lie folded back on a neighbour, or have next to no area."""
        folded = _folded(_area_vectors(V, self.F), self._beside, self._least_double_areas)
        return int((folded & ~self._folded_at_rest).sum())

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
    """Whether triangles lie back to back on one beside them, or have less than the least area.

    `vectors` [m, 3] are normals as long as the double areas, `beside` [m, 3] the triangles beyond
    the sides, and `least` [m] the least double areas.
    """
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
                other_square = u * u + v * v + w * w
                least_square = _BACK_TO_BACK_COSINE**2 * square * other_square
                folded[i] |= along < 0 and along * along > least_square
    return folded


@kernel
def _vertex_normals(vectors: Floats, F: Ints, count: int) -> Floats:
    """Unit sum of the vectors [m, 3] of the triangles at each vertex; along z if the sum is 0."""
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
    """Connected component of each of `count` nodes, numbered by first occurrence.

    The links between nodes are pairs [k, 2].
    """
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
    """Mask of the triangles to turn over, so that linked ones are wound alike as far as possible.

    Each component follows its first triangle, along a tree of shortest paths. On a one-sided
    surface links stay that disagree, where paths from both sides meet.

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
    # two triangles with two common sides have two links: the shorter one decides (coo would add
    # both)
    low = pairs.min(axis=1)
    high = pairs.max(axis=1)
    key = low * count + high
    order = np.lexsort((length, key))
    single = order[np.append(True, np.diff(key[order]) != 0)]
    graph = coo_array((length[single], (low[single], high[single])), shape=(count, count)).tocsr()
    roots = np.unique(labels(pairs, count), return_index=True)[1]
    _, predecessor, _ = dijkstra(
        graph, directed=False, indices=roots, return_predecessors=True, min_only=True
    )
    others = np.flatnonzero(predecessor >= 0)  # all triangles but the roots
    parent = np.arange(count)
    parent[others] = predecessor[others]
    low_end = np.minimum(others, parent[others])
    high_end = np.maximum(others, parent[others])
    link = np.searchsorted(key[single], low_end * count + high_end)
    result[others] = against[single][link]
    # add up the turns along the path to the root, by doubling
    while (parent[parent] != parent).any():
        result ^= result[parent]
        parent = parent[parent]
    return result
