"""Repairs made without asking: duplicate and unused vertices, hairline cracks, winding. `fixes` lists them."""

from __future__ import annotations

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ripple_sim.solver.errors import MeshError

from .topology import distinct, edges_of

# Relative to the size of the mesh: above the round-off of a file in float32, far below any gap that is meant.
_CRACK = 1e-6
# A surface that encloses less, relative to the cube of its size, has no inside.
_FLAT = 1e-12


def merge_vertices(
    V: NDArray[np.float64], F: NDArray[np.int64], fixes: list[str]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.bool_]]:
    """Merge equal positions; drop collapsed and repeated triangles and unused vertices.

    Returns
    -------
    V, F
        A clean mesh stays unchanged.
    keep : bool [triangle_count]
        Which of the given triangles are left.
    """
    used = np.zeros(len(V), dtype=bool)
    used[F] = True
    if not used.all():
        fixes.append(f"{(~used).sum()} unreferenced vertices dropped")
    V, F = V[used], (np.cumsum(used) - 1)[F]
    # + 0.0 turns -0.0 into 0.0, which are the same place
    first = _first_equal(V + 0.0)
    duplicates = (first != np.arange(len(V))).sum()
    if duplicates:
        fixes.append(f"{duplicates} duplicate vertices merged")
    F = first[F]
    joined = _joined_cracks(V, F)
    if (joined != F).any():
        fixes.append(f"cracks closed: {len(np.unique(F)) - len(np.unique(joined))} boundary vertices joined")
        F = joined
    collapsed = (F[:, 0] == F[:, 1]) | (F[:, 1] == F[:, 2]) | (F[:, 2] == F[:, 0])
    if collapsed.any():
        fixes.append(f"{collapsed.sum()} triangles with a repeated vertex dropped")
    repeated = (_first_equal(np.sort(F, axis=1)) != np.arange(len(F))) & ~collapsed
    if repeated.any():
        fixes.append(f"{repeated.sum()} repeated triangles dropped")
    keep = ~(collapsed | repeated)
    F = F[keep]
    used = np.zeros(len(V), dtype=bool)
    used[F] = True
    return V[used], (np.cumsum(used) - 1)[F], keep


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
    pairs = cKDTree(V[rim]).query_pairs(_CRACK * np.ptp(V[F.ravel()], axis=0).max(), output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(rim), len(rim)))
    _, label = connected_components(graph, directed=False)
    target = np.arange(len(V))
    target[rim] = rim[np.unique(label, return_index=True)[1]][label]
    return target[F]


def orient_outward(
    V: NDArray[np.float64], F: NDArray[np.int64], corner_uv: NDArray[np.float64] | None, fixes: list[str], name: str
) -> tuple[NDArray[np.int64], NDArray[np.float64] | None]:
    """Turn all triangles of a closed surface counter-clockwise seen from outside.

    Raises
    ------
    MeshError
        If the surface is one-sided or encloses no volume.
    """
    oriented = igl.bfs_orient(F)[0].astype(np.int64)
    half_edges = oriented * len(V) + np.roll(oriented, -1, axis=1)
    if len(distinct(half_edges)) < half_edges.size:
        raise MeshError(f"{name} is not orientable (one-sided, like a Klein bottle); valid is a two-sided surface")
    volume = signed_volume(V, oriented)
    extent = np.ptp(V, axis=0).max()
    if not abs(volume) > _FLAT * extent**3:
        raise MeshError(f"{name} is degenerate: it encloses no volume ({volume:.3g} m^3 at a size of {extent:.3g} m)")
    flip = (oriented != F).any(axis=1)
    if volume < 0:
        flip = ~flip
    if flip.all():
        fixes.append("turned inside out (the triangles faced inwards)")
    elif flip.any():
        fixes.append(f"{flip.sum()} triangles reversed (inconsistent winding)")
    F = np.where(flip[:, None], F[:, ::-1], F)
    if corner_uv is not None:
        corner_uv = np.where(flip[:, None, None], corner_uv[:, ::-1], corner_uv)
    return F, corner_uv


def signed_volume(V: NDArray[np.float64], F: NDArray[np.int64]) -> float:
    """Volume that a closed surface encloses [m^3], negative if its triangles face inwards."""
    a, b, c = (V[F[:, k]] - V.mean(axis=0) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
