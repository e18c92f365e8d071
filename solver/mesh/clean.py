"""What is done to every surface as it is read, without asking: nothing that could be seen.

Equal vertices are merged, hairline cracks closed, and triangles dropped that collapse or repeat. Triangles without
area, whose corners lie on a line, are taken out without opening the surface.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..errors import MeshError
from .corners import Corners, counted, oriented
from .sheets import cut_apart
from .topology import distinct, undirected

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
    edge, counts = np.unique(undirected(F)[0], return_counts=True)
    low, high = np.divmod(edge[counts == 1], F.max() + 1)
    rim = np.union1d(low[low != high], high[low != high])
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


# Height over longest side below which three corners lie on a line: a little above the round-off of float64.
_FLAT = 1e-12
_ROUNDS = 64


def without_slivers(V: NDArray[np.float64], corners: Corners) -> tuple[Corners, int]:
    """Drop triangles whose corners lie on a line; what bordered on the longest side gets the middle corner.

    Returns
    -------
    corners : Corners
        Unchanged where there are none.
    dropped : int
        How many triangles were dropped.
    """
    flat = _flat(V, corners.F)[0]
    before = int(flat.sum())
    for _ in range(_ROUNDS):
        if not flat.any():
            return corners, before
        corners = _round(V, corners)
        flat = _flat(V, corners.F)[0]
    return corners.kept(~flat), before


def _flat(V: NDArray[np.float64], F: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which triangles have no area, and the lengths of all sides [m, 3]."""
    sides = V[np.roll(F, -1, axis=1)] - V[F]
    length = np.linalg.norm(sides, axis=-1)
    twice_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return twice_area <= _FLAT * length.max(axis=1) ** 2, length


def _round(V: NDArray[np.float64], corners: Corners) -> Corners:
    """Take out slivers of which no two are neighbours, the longest first."""
    F = corners.F
    flat, length = _flat(V, F)
    longest = length.argmax(axis=1)
    rank = np.full(len(F), -1)
    rank[np.lexsort((length.max(axis=1), flat))] = np.arange(len(F))
    rank[~flat] = -1
    key = np.sort(np.stack([F, np.roll(F, -1, axis=1)], axis=-1), axis=-1) @ [len(V), 1]
    edge = np.unique(key, return_inverse=True)[1].reshape(-1, 3)
    highest = np.full(edge.max() + 1, -1)
    np.maximum.at(highest, edge, np.repeat(rank[:, None], 3, axis=1))
    out = flat & (highest[edge] == rank[:, None]).all(axis=1)
    removed = np.flatnonzero(out)
    source = np.full(len(highest), -1)
    source[edge[removed, longest[removed]]] = removed
    source = np.where(out[:, None], -1, source[edge])
    corner = (longest[source] + 2) % 3
    point, given = (np.where(source >= 0, x[source, corner], -1) for x in (F, corners.given))
    share = np.linalg.norm(V[point] - V[F], axis=-1) / np.maximum(length, np.finfo(float).tiny)
    split = corners.kept(~out).split(point[~out], given[~out], share[~out])
    return split.kept(distinct_triangles(split.F))


def cleaned(
    V: NDArray[np.float64], F: NDArray[np.int64], uv: NDArray[np.float64] | None, name: str
) -> tuple[NDArray[np.float64], Corners, tuple[str, ...]]:
    """Make a triangle soup a manifold, oriented surface of triangles that have an area.

    Parameters
    ----------
    V : [vertex_count, 3]
    F : [triangle_count, 3]
    uv : [triangle_count, 3, 2], optional
    name : str
        Its name in messages.

    Returns
    -------
    V, corners
        A surface that needs nothing stays unchanged.
    notes : tuple of str
        What was done, one line each.

    Raises
    ------
    MeshError
        If no triangle has an area.
    """
    unused = len(V) - len(distinct(F))
    notes = [f"{counted(unused, 'unreferenced vertex')} dropped"] if unused else []
    merged, joined = merged_vertices(V, F)
    empty, keep = collapsed(merged), distinct_triangles(merged)
    corners, slivers = without_slivers(V, Corners(merged, F, uv).kept(keep))
    if len(corners.F) == 0:
        raise MeshError(f"{name} has no triangle with an area: none has three different corners that lie on no line")
    first_given = distinct(corners.F)
    compact = np.searchsorted(first_given, corners.F)
    points, corners, cuts = cut_apart(V[first_given], Corners(compact, corners.given, corners.uv), first_given)
    merges, splits = _changes(corners)
    turned, turns = oriented(points, corners)
    said = {
        f"{counted(merges - joined, 'duplicate vertex')} merged": merges > joined,
        f"cracks closed: {counted(joined, 'boundary vertex')} joined": joined,
        f"{counted(int(empty.sum()), 'triangle')} with a repeated vertex dropped": empty.any(),
        f"{counted(int((~keep & ~empty).sum()), 'repeated triangle')} dropped": (~keep & ~empty).any(),
        f"{counted(slivers, 'triangle')} without area dropped": slivers,
    }
    notes += [note for note, true in said.items() if true]
    # of a surface that was cut before, equal positions are merged and cut again, which nobody needs to know
    notes += cuts if merges or splits else []
    return points, turned, (*notes, *turns)


def _changes(corners: Corners) -> tuple[int, int]:
    """How many vertices became one with others, and how many came to be by cutting."""
    vertices, given = corners.F.max() + 1, corners.given.ravel()
    old = given >= 0
    pairs = distinct(given[old] * vertices + corners.F.ravel()[old])
    kept = len(distinct(pairs % vertices))
    return len(pairs) - kept, len(pairs) - len(distinct(given[old])) + int(vertices) - kept
