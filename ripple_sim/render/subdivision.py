"""Split long edges of a triangle mesh at their midpoints, without opening gaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def subdivide(
    F: NDArray, attributes: NDArray, directions: slice, *, max_angle: float, max_faces: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Split edges until none spans more than `max_angle` or the mesh has about `max_faces` triangles.

    Parameters
    ----------
    F : array, shape [m, 3]
        Triangles.
    attributes : array, shape [n, k]
        What the vertices carry; a midpoint carries the mean of its edge's ends.
    directions : slice
        The three columns of `attributes` between which the angle of an edge is measured.
    max_angle : float
        [radians]
    max_faces : int
        The longest edges are split first; a mesh that is finer from the start stays as it is.

    Returns
    -------
    F, attributes
        The finer mesh. The original vertices come first.
    """
    F, attributes = np.asarray(F, dtype=np.int64), np.asarray(attributes, dtype=np.float64)
    while len(F) < max_faces:
        sides = np.stack([F, np.roll(F, -1, axis=1)], axis=2).reshape(-1, 2)
        edges, edge_of_side = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
        angle = _angle(attributes[edges[:, 0], directions], attributes[edges[:, 1], directions])
        marked = _longest(angle, max_angle, max_faces - len(F))
        if not marked.any():
            break
        midpoint = np.full(len(edges), -1)
        midpoint[marked] = len(attributes) + np.arange(marked.sum())
        attributes = np.concatenate([attributes, attributes[edges[marked]].mean(axis=1)])
        F = _split(F, midpoint[edge_of_side.reshape(-1, 3)], attributes[:, directions])
    return F, attributes


def _angle(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))


def _longest(angle: NDArray, max_angle: float, new_faces: int) -> NDArray[np.bool_]:
    """Mark the edges over the limit; a split edge makes two more triangles, so only the longest that fit."""
    budget = max(new_faces // 2, 1)
    if budget < len(angle):
        max_angle = max(max_angle, np.partition(angle, len(angle) - budget)[len(angle) - budget])
    # half of the longest edge as a floor keeps the triangles in shape: long edges are split first
    return angle > max(max_angle, angle.max() / 2)


def _split(F: NDArray, middle: NDArray, directions: NDArray) -> NDArray[np.int64]:
    """Cut every triangle into 1 to 4 by the midpoints of its sides (side k runs from corner k to k + 1), -1 = none."""
    count = (middle >= 0).sum(axis=1)
    parts = [F[count == 0]]

    f, m = F[count == 3], middle[count == 3]
    parts += [np.stack([f[:, k], m[:, k], m[:, k - 1]], axis=1) for k in range(3)] + [m]

    # turn the triangle so that its only split side, or its only whole one, is side 0
    f, m = _turned(F[count == 1], middle[count == 1], np.argmax(middle[count == 1] >= 0, axis=1))
    parts += [np.stack([f[:, 0], m[:, 0], f[:, 2]], axis=1), np.stack([m[:, 0], f[:, 1], f[:, 2]], axis=1)]

    f, m = _turned(F[count == 2], middle[count == 2], np.argmin(middle[count == 2] >= 0, axis=1))
    parts.append(np.stack([m[:, 2], m[:, 1], f[:, 2]], axis=1))
    # the remaining quadrilateral f0 f1 m1 m2 is cut along its shorter diagonal
    first = _angle(directions[f[:, 0]], directions[m[:, 1]]) <= _angle(directions[f[:, 1]], directions[m[:, 2]])
    a, b = (f[first], m[first]), (f[~first], m[~first])
    parts += [
        np.stack([a[0][:, 0], a[0][:, 1], a[1][:, 1]], axis=1),
        np.stack([a[0][:, 0], a[1][:, 1], a[1][:, 2]], axis=1),
    ]
    parts += [
        np.stack([b[0][:, 0], b[0][:, 1], b[1][:, 2]], axis=1),
        np.stack([b[0][:, 1], b[1][:, 1], b[1][:, 2]], axis=1),
    ]
    return np.concatenate(parts)


def _turned(F: NDArray, middle: NDArray, first: NDArray) -> tuple[NDArray, NDArray]:
    index = (first[:, None] + np.arange(3)) % 3
    return np.take_along_axis(F, index, axis=1), np.take_along_axis(middle, index, axis=1)
