"""Triangles without area, whose corners lie on a line, taken out without opening the surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .corners import Corners
from .merging import distinct_triangles

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
