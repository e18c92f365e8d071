"""Disks laid out flat in convex polygons, without a fold.

Each inner vertex is a mean of its neighbours with positive weights, so that the map is one to one (Tutte 1963, Floater
2003), whatever the weights; mean-value weights follow the shape of the triangles.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import splu

from ...kernel import Floats, Ints, kernel
from ..sphere_map.vectors import dot, row, subtract
from .surface import Surface

# half-angle tangents; beyond them triangles are so bad that round-off would fold them
_LEAST, _MOST = 1e-3, 1e3


@dataclasses.dataclass(frozen=True, eq=False)
class Border:
    """Places of the vertices on the borders of parts.

    Attributes
    ----------
    part, vertex : int64 [b]
    place : float64 [b, 2]
    """

    part: NDArray[np.int64]
    vertex: NDArray[np.int64]
    place: NDArray[np.float64]


def flattened(surface: Surface, part: NDArray[np.int64], border: Border) -> NDArray[np.float64]:
    """Places [m, 3, 2] of the triangles' corners, each part [m] laid out inside its border.

    A part that round-off folds with mean-value weights is laid out with equal ones.
    """
    size = len(surface.V)
    key, copies = np.unique(part[:, None] * size + surface.F, return_inverse=True)
    corners = copies.reshape(-1, 3)
    fixed = np.full(len(key), -1)
    fixed[np.searchsorted(key, border.part * size + border.vertex)] = np.arange(len(border.part))
    start = np.where(fixed[:, None] >= 0, border.place[fixed], np.nan)
    weights = _mean_value_weights(surface)
    places = _solved(corners, weights, start)[corners]
    folded = np.isin(part, part[signed_areas(places) <= 0])
    if folded.any():
        weights[folded] = 1.0
        places = _solved(corners, weights, start)[corners]
    return places


def signed_areas(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Areas [m] of flat triangles [m, 3, 2], positive where they are counter-clockwise."""
    u, v = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    return (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2


def along(V: NDArray[np.float64], paths: list[NDArray[np.int64]]) -> NDArray[np.float64]:
    """How far along its path each vertex lies, from 0 to 1; the paths' one behind the other."""
    last = np.cumsum([len(each) for each in paths])
    return _along(V, np.concatenate(paths), last)


@kernel
def _along(V: Floats, vertices: Ints, last: Ints) -> Floats:
    result, first = np.zeros(len(vertices)), 0
    for end in last:
        longest = 0.0
        for i in range(first + 1, end):
            step = subtract(row(V, vertices[i]), row(V, vertices[i - 1]))
            result[i] = np.sqrt(dot(step, step))
            longest = max(longest, result[i])
        for i in range(first + 1, end):
            result[i] = max(result[i], 1e-6 * longest + 1e-300) + result[i - 1]
        total = result[end - 1]
        for i in range(first + 1, end):
            result[i] /= total
        first = end
    return result


def _mean_value_weights(surface: Surface) -> NDArray[np.float64]:
    """Weights [m, 3, 2], in corner k of a triangle, of its next vertex and of the one before."""
    weights = np.empty((len(surface.F), 3, 2))
    tiny = np.finfo(np.float64).tiny
    for k in range(3):
        x, y, z = (surface.V[surface.F[:, (k + j) % 3]] for j in range(3))
        u, v = y - x, z - x
        lu, lv = np.linalg.norm(u, axis=1), np.linalg.norm(v, axis=1)
        sine, cosine = np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v)
        tangent = np.clip(np.tan(np.arctan2(sine, cosine) / 2), _LEAST, _MOST)
        weights[:, k, 0], weights[:, k, 1] = tangent / np.maximum(lu, tiny), tangent / np.maximum(lv, tiny)
    return weights


def _solved(
    corners: NDArray[np.int64], weights: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Places [n, 2] of all vertices; NaN in `start` is what is looked for."""
    free = np.isnan(start[:, 0])
    row = np.repeat(corners, 2, axis=1).ravel()
    column = np.stack([np.roll(corners, -1, axis=1), np.roll(corners, 1, axis=1)], axis=2).ravel()
    chosen = free[row]
    matrix = csr_array((weights.ravel()[chosen], (row[chosen], column[chosen])), shape=(len(start), len(start)))
    total = np.asarray(matrix.sum(axis=1))
    rows = matrix[free]
    rows.data /= np.repeat(total[free], np.diff(rows.indptr))
    system = csc_array(-rows[:, free])
    system.setdiag(1.0)
    places = start.copy()
    places[free] = splu(system).solve(rows[:, ~free] @ start[~free])
    return places
