"""Finer and coarser meshes of the same shape.

`tessellate` splits long edges at their midpoints; smooth surfaces get rounder. `coarse_mesh` keeps
few of the vertices, spread evenly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ripple_sim.solver.mesh.topology import Edges, edges_of, undirected

# Columns of the vertex attributes.
POSITION = slice(0, 3)  # [m]
NORMAL = slice(3, 6)  # jumps at creases
COORDINATES = slice(6, 9)  # for the chart map
DIRECTION = slice(9, 12)  # in which a vertex is displaced: the smooth normal
BAKED = slice(12, 15)  # ambient visibility, thickness, inner ambient visibility
UV = slice(15, 17)  # texture coordinates


def tessellate(
    F: NDArray,
    attributes: NDArray,
    same: NDArray,
    *,
    max_length: float,
    max_faces: int,
    crease_length: float | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Split edges until none is too long, or the mesh has about `max_faces` triangles.

    A midpoint has the mean of its ends' attributes. Between two triangles that share the normals at
    both ends of their edge it also bulges out to where a surface with these normals would be: half
    the way to the mean of its projections onto the ends' tangent planes (Boubekeur and Alexa, Phong
    Tessellation, 2008); half is exact on a sphere to second order. Creases and open edges stay
    straight. No gaps open.

    Parameters
    ----------
    F : array, shape [m, 3]
        Triangles.
    attributes : array, shape [n, k]
        Of the vertices, in the columns above, of which those from COORDINATES on may be missing.
    same : array, shape [n]
        Whole numbers, equal for vertices that differ in their texture coordinates at most: a seam
        is no crease.
    max_length : float
        Of the edges [m].
    max_faces : int
        The longest edges are split first; a mesh that is finer from the start stays as it is.
    crease_length : float, optional
        Creases and open edges are split further, to this length [m], for a quarter more triangles
        at most: both sides of them contrast, so that corners of the displaced edge would show where
        those of other edges do not.

    Returns
    -------
    F, attributes, same
        The finer mesh, as above. The original vertices come first.
    """
    F = np.asarray(F, dtype=np.int64)
    attributes = np.asarray(attributes, dtype=np.float64)
    same = np.asarray(same, dtype=np.int64)
    max_total = max_faces if crease_length is None else max(max_faces, len(F)) * 5 // 4
    while len(F) < max_total:
        edges = edges_of(F)
        weld, inner = welded(edges, F, same)
        length = np.linalg.norm(
            attributes[edges.ends[:, 0], POSITION] - attributes[edges.ends[:, 1], POSITION], axis=1
        )
        marked = _longest(length, max_length, max_faces - len(F))
        if crease_length is not None and not marked.any():
            marked = _longest(np.where(inner, 0.0, length), crease_length, max_total - len(F))
        if not marked.any():
            break
        midpoint = np.full(len(marked), -1)
        midpoint[marked] = len(attributes) + np.arange(marked.sum())
        same = np.concatenate([same, same.max() + 1 + weld[marked]])
        attributes = np.concatenate([attributes, midpoints(edges.ends, inner, attributes)[marked]])
        F = _split(F, midpoint[edges.of_side], attributes[:, POSITION])
    return F, attributes, same


def welded(
    edges: Edges, F: NDArray[np.int64], same: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Which edges [k] of triangles [m, 3] are one, and whether an edge is an inner one.

    The first array has equal numbers for edges whose ends differ in their texture coordinates at
    most. An edge is an inner one if two triangles share it and the normals at its ends. `same` is
    as for `tessellate`.
    """
    _, weld_of_side = np.unique(undirected(same[F])[0], return_inverse=True)
    weld = np.empty(len(edges.ends), dtype=np.int64)
    weld[edges.of_side.ravel()] = weld_of_side
    return weld, np.bincount(weld_of_side)[weld] == 2


def midpoints(
    ends: NDArray[np.int64], inner: NDArray[np.bool_], attributes: NDArray
) -> NDArray[np.float64]:
    """Attributes of the midpoints of all edges, [k, ...]; see `tessellate`."""
    a = attributes[ends[:, 0]]
    b = attributes[ends[:, 1]]
    middle = (a + b) / 2
    middle[:, POSITION] += bulges(ends, inner, attributes)
    middle[:, NORMAL] /= np.maximum(np.linalg.norm(middle[:, NORMAL], axis=1, keepdims=True), 1e-12)
    return middle


def bulges(
    ends: NDArray[np.int64], inner: NDArray[np.bool_], attributes: NDArray
) -> NDArray[np.float64]:
    """How far the midpoints of all edges move out [m], [k, 3]; see `tessellate`."""
    a = attributes[ends[:, 0]]
    b = attributes[ends[:, 1]]
    half = (b[:, POSITION] - a[:, POSITION]) / 2
    normal_a = a[:, NORMAL]
    normal_b = b[:, NORMAL]
    above_a = np.einsum("ij,ij->i", half, normal_a)[:, None] * normal_a
    above_b = np.einsum("ij,ij->i", half, normal_b)[:, None] * normal_b
    return inner[:, None] * ((above_b - above_a) / 4)


def _longest(length: NDArray, max_length: float, new_faces: int) -> NDArray[np.bool_]:
    """Mark the edges that are longer than `max_length`, but only the longest ones.

    A split edge makes two more triangles; there is room for `new_faces`.
    """
    if new_faces <= 0:
        return np.zeros(len(length), np.bool_)
    budget = max(new_faces // 2, 1)
    if budget < len(length):
        rank = len(length) - budget
        max_length = max(max_length, np.partition(length, rank)[rank])
    # half of the longest edge as a floor keeps the triangles in shape: long edges are split first
    return length > max(max_length, length.max() / 2)


def _split(F: NDArray, middle: NDArray, positions: NDArray) -> NDArray[np.int64]:
    """Cut every triangle [m, 3] into 1 to 4 by the midpoints of its sides.

    `middle` [m, 3] are the midpoints, -1 where a side is not split; side k runs from corner k to
    corner k + 1.
    """
    split = middle >= 0
    count = (middle >= 0).sum(axis=1)
    # turn the triangles so that their only split side, or their only whole one, is side 0
    first = np.where(count == 1, split.argmax(axis=1), split.argmin(axis=1))
    index = (first[:, None] + np.arange(3)) % 3
    # columns 0 to 2 are a triangle's corners, 3 to 5 the midpoints of its sides
    points = np.hstack(
        [np.take_along_axis(F, index, axis=1), np.take_along_axis(middle, index, axis=1)]
    )
    one = points[count == 1]
    two = points[count == 2]
    three = points[count == 3]
    # with two midpoints the quadrilateral 0 1 4 5 is left, and cut along its shorter diagonal
    diagonals = np.linalg.norm(positions[two[:, :2]] - positions[two[:, 4:]], axis=2)
    shorter = diagonals[:, 0] <= diagonals[:, 1]
    patterns = [
        (three, [[0, 3, 5], [1, 4, 3], [2, 5, 4], [3, 4, 5]]),
        (one, [[0, 3, 2], [3, 1, 2]]),
        (two, [[5, 4, 2]]),
        (two[shorter], [[0, 1, 4], [0, 4, 5]]),
        (two[~shorter], [[0, 1, 5], [1, 4, 5]]),
    ]
    parts = [F[count == 0]]
    for triangles, pattern in patterns:
        for corners in pattern:
            parts.append(triangles[:, corners])
    return np.concatenate(parts)


def coarse_mesh(
    F: NDArray[np.int64], features: NDArray[np.float64], count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Merge the vertices of a mesh into `count` vertices that are far from one another.

    Every vertex is merged with the nearest of these (Rossignac and Borrel 1993).

    Parameters
    ----------
    F : int64 [m, 3]
    features : float64 [n, d]
        Of the vertices; distances are measured between features.

    Returns
    -------
    vertices : int64 [k]
        The vertices that are left.
    F : int64 [m, 3]
        Triangles between them.
    """
    if len(features) <= count:
        return np.arange(len(features)), np.asarray(F)
    # Each chosen vertex is the farthest from the ones chosen before. `owner` is the number of the
    # nearest chosen vertex to every vertex. Plain NumPy, column by column, takes twice the time of
    # a compiled loop, and less than to compile the loop.
    columns = np.ascontiguousarray(features.T)
    chosen = np.zeros(count, np.int64)
    owner = np.zeros(len(features), np.int64)
    square = np.full(len(features), np.inf)
    latest = 0
    for k in range(count):
        chosen[k] = latest
        distance = np.zeros(len(features))
        for column in columns:
            distance += np.square(column - column[latest])
        nearer = distance < square
        np.copyto(square, distance, where=nearer)
        owner[nearer] = k
        latest = int(square.argmax())
    merged = owner[F]
    merged = merged[(merged != np.roll(merged, 1, axis=1)).all(axis=1)]
    # triangles begin with their least vertex, so that equal triangles are equal rows
    first = merged.argmin(axis=1)[:, None]
    return chosen, np.unique(np.take_along_axis(merged, (first + np.arange(3)) % 3, axis=1), axis=0)
