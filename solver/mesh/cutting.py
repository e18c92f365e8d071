"""Surfaces cut apart where they touch themselves, so that what is left is manifold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .corners import Corners
from .counting import counted
from .sides import join_sides
from .winding import labels

# Where a vertex is put into an edge, counted from the lower one: not in the middle, where another may lie already.
_BETWEEN = 0.382


def cut_apart(
    V: NDArray[np.float64], corners: Corners, first_given: NDArray[np.int64]
) -> tuple[NDArray[np.float64], Corners, list[str]]:
    """Give every sheet vertices of its own where surfaces touch along an edge or at a vertex.

    Parameters
    ----------
    V : [vertex_count, 3]
    corners : Corners
    first_given : [vertex_count]
        Lowest number under which each vertex was given.

    Returns
    -------
    V, corners
        A manifold, orientable surface. Vertices keep their order, those of a vertex that was cut standing together.
    notes : list of str
        What was cut.
    """
    joints = join_sides(V, corners)
    fan = _fans(corners.F, joints.pairs)
    vertex = np.empty(fan.max() + 1, dtype=np.int64)
    vertex[fan] = corners.F.ravel()
    whole = np.bincount(vertex, minlength=len(V))[vertex] == 1
    lowest = np.full(len(vertex), corners.given.max() + 1)
    np.minimum.at(lowest, fan, corners.given.ravel())
    order = np.argsort(np.where(whole, first_given[vertex], lowest), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    cut = Corners(rank[fan].reshape(-1, 3), corners.given, corners.uv)
    V, cut = _without_double_edges(V[vertex[order]], cut, joints.pairs)
    notes = []
    if len(joints.crowded):
        notes.append(f"cut apart along {counted(len(joints.crowded), 'edge')} where more than two triangles met")
    if len(joints.one_sided):
        notes.append(f"cut open along {counted(len(joints.one_sided), 'edge')}: one-sided, like a Moebius band")
    touched = _ends(corners.F, np.append(joints.crowded, joints.one_sided))
    pinched = np.setdiff1d(vertex[~whole], touched)
    if len(pinched):
        notes.append(f"cut apart at {counted(len(pinched), 'vertex')} where the surface touched itself")
    return V, cut, notes


def _fans(F: NDArray[np.int64], pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Fan of triangles to which each corner belongs, numbered by first occurrence: corners linked over joined sides."""
    start = F.ravel()
    next_corner = np.arange(len(start)).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    one, two = pairs.T
    same_way = start[one] == start[two]
    ends = np.where(same_way, two, next_corner[two]), np.where(same_way, next_corner[two], two)
    links = np.concatenate([np.stack([one, ends[0]], axis=1), np.stack([next_corner[one], ends[1]], axis=1)])
    return labels(links, len(start))


def _ends(F: NDArray[np.int64], sides: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([F.ravel()[sides], np.roll(F, -1, axis=1).ravel()[sides]])


def _without_double_edges(
    V: NDArray[np.float64], corners: Corners, pairs: NDArray[np.int64]
) -> tuple[NDArray[np.float64], Corners]:
    """Where two edges have both vertices in common, all but the first get a vertex of their own in between."""
    F = corners.F
    mate = np.arange(F.size)
    mate[pairs[:, 0]], mate[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
    leader = np.minimum(np.arange(F.size), mate)
    a, b = F.ravel(), np.roll(F, -1, axis=1).ravel()
    key = np.minimum(a, b) * len(V) + np.maximum(a, b)
    order = np.lexsort((leader, key))
    ordered, lead = key[order], leader[order]
    begins = np.append(True, ordered[1:] != ordered[:-1])
    first = lead[begins][np.cumsum(begins) - 1]
    again = order[lead != first]
    if len(again) == 0:
        return V, corners
    leaders, number = np.unique(leader[again], return_inverse=True)
    point, given = np.full((2, *F.shape), -1)
    point.flat[again] = len(V) + number
    low, high = np.minimum(a, b)[leaders], np.maximum(a, b)[leaders]
    between = (1 - _BETWEEN) * V[low] + _BETWEEN * V[high]
    share = np.where(a < b, _BETWEEN, 1 - _BETWEEN).reshape(F.shape)
    return np.vstack([V, between]), corners.split(point, given, share)
