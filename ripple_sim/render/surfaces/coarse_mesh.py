"""A mesh with few of the vertices of another one, spread evenly, that moves with it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class CoarseMesh(NamedTuple):
    """Some of the vertices of a mesh.

    Attributes
    ----------
    vertices : int64 [k]
        Of the mesh.
    F : int64 [m, 3]
        Triangles between them.
    """

    vertices: NDArray[np.int64]
    F: NDArray[np.int64]


def coarse_mesh(F: NDArray[np.int64], features: NDArray[np.float64], count: int) -> CoarseMesh:
    """Merge every vertex with the nearest of `count` that are far from one another (Rossignac and Borrel 1993).

    Parameters
    ----------
    F : int64 [m, 3]
    features : float64 [n, d]
        Of the vertices; near is what is near in them.
    count : int
    """
    if len(features) <= count:
        return CoarseMesh(np.arange(len(features)), np.asarray(F))
    chosen, owner = _spread(features, count)
    merged = owner[F]
    merged = merged[(merged != np.roll(merged, 1, axis=1)).all(axis=1)]
    # each begins with its least vertex, so that the same triangle is the same row
    first = merged.argmin(axis=1)[:, None]
    return CoarseMesh(chosen, np.unique(np.take_along_axis(merged, (first + np.arange(3)) % 3, axis=1), axis=0))


def _spread(features: NDArray[np.float64], count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows [count], each the farthest from those before, and the number among them of the nearest to every row [n].

    In plain numpy, column by column: it takes twice the time of a compiled loop, and less than to compile that.
    """
    columns = np.ascontiguousarray(features.T)
    chosen, owner = np.zeros(count, np.int64), np.zeros(len(features), np.int64)
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
    return chosen, owner
