"""Checks of a surface's topology: closed, manifold, one part, genus 0. Defects come with numbers and places."""

from __future__ import annotations

import igl
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ripple_sim.solver.errors import MeshError


def check_topology(V: NDArray[np.float64], F: NDArray[np.int64], name: str) -> None:
    """Raise `MeshError`, naming every defect, unless the triangles are a closed, connected, manifold, genus-0 surface.

    Parameters
    ----------
    V : [vertex_count, 3]
        Vertices, all of them in use.
    F : [triangle_count, 3]
    name : str
        Its name in messages.
    """
    if len(F) == 0:
        raise MeshError(f"{name} is not a closed genus-0 surface: no triangle of it has three different corners")
    edges, counts = edges_of(F)
    defects = []
    parts = igl.facet_components(F)[0]
    if parts > 1:
        defects.append(f"in {parts} separate parts (valid is one; keep the part you want, or join them)")
    crowded = edges[counts > 2]
    if len(crowded):
        where = _place(V[crowded[0]].mean(axis=0))
        defects.append(f"non-manifold: {_count(len(crowded), 'edge')} in more than two triangles (one near {where})")
    boundary = edges[counts == 1]
    if len(boundary):
        holes = _loops(boundary, len(V))
        where = _place(V[boundary[0]].mean(axis=0))
        defects.append(
            f"open: {_count(len(boundary), 'boundary edge')} round {_count(holes, 'hole')} (one near {where})"
        )
    if not defects:
        pinched = _pinched_vertices(F, len(V))
        if len(pinched):
            where = _place(V[pinched[0]])
            defects.append(
                f"non-manifold: {_count(len(pinched), 'vertex')} where the surface touches itself (one near {where})"
            )
    if not defects:
        euler = len(V) - len(edges) + len(F)
        if euler % 2:
            defects.append(f"one-sided, with an Euler characteristic of {euler} (valid is 2)")
        elif euler != 2:
            defects.append(f"of genus {(2 - euler) // 2} (valid is genus 0: no handles or tunnels)")
    if defects:
        raise MeshError(f"{name} is not a closed genus-0 surface: it is {', and '.join(defects)}")


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


def _loops(edges: NDArray[np.int64], vertex_count: int) -> int:
    graph = coo_array((np.ones(len(edges)), edges.T), shape=(vertex_count, vertex_count))
    _, label = connected_components(graph, directed=False)
    return len(np.unique(label[edges[:, 0]]))


def _pinched_vertices(F: NDArray[np.int64], vertex_count: int) -> NDArray[np.int64]:
    """Vertices whose triangles form more than one fan, on a mesh whose edges all have two triangles."""
    # Each triangle corner is a node; corners of one vertex in two triangles that share an edge at it are linked.
    corner = np.arange(3 * len(F)).reshape(-1, 3)
    edge_ends = F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edge_corners = corner[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    swap = edge_ends[:, 0] > edge_ends[:, 1]
    edge_ends[swap], edge_corners[swap] = edge_ends[swap][:, ::-1], edge_corners[swap][:, ::-1]
    order = np.argsort(edge_ends[:, 0] * vertex_count + edge_ends[:, 1], kind="stable")
    pairs = edge_corners[order].reshape(-1, 2, 2)
    rows, columns = pairs[:, 0].ravel(), pairs[:, 1].ravel()
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(corner.size, corner.size))
    _, fan = connected_components(graph, directed=False)
    fans = distinct(F.ravel() * corner.size + fan) // corner.size
    return np.flatnonzero(np.bincount(fans, minlength=vertex_count) > 1)


def _count(number: int, thing: str) -> str:
    return f"{number} {thing if number == 1 else {'vertex': 'vertices'}.get(thing, thing + 's')}"


def _place(point: NDArray[np.float64]) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in point) + ")"
