"""Which sheets go on in which where more than two triangles meet along an edge."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from .topology import undirected

# Sides on one edge up to which every pair is weighed; beyond, only neighbours round the edge.
_ALL_PAIRS = 12


def matched(
    V: NDArray[np.float64],
    F: NDArray[np.int64],
    sides: NDArray[np.int64],
    sheet: NDArray[np.int64],
    flip: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """Join sides of crowded edges two by two, the best pairs first, none that would make the surface one-sided.

    Parameters
    ----------
    V, F : [vertex_count, 3], [triangle_count, 3]
    sides : [k]
        Sides that are to be joined, numbered 3 x triangle + side.
    sheet : [triangle_count]
        Sheet to which each triangle belongs so far.
    flip : bool [triangle_count]
        Triangles to be turned for the windings of each sheet to agree.

    Returns
    -------
    int64 [pair_count, 2]
    """
    if len(sides) == 0:
        return np.empty((0, 2), dtype=np.int64)
    key, forward = undirected(F)
    forward = forward ^ np.repeat(flip, 3)
    sides = sides[np.argsort(key[sides], kind="stable")]
    angle = _angles(V, F, sides, key[sides])
    order = np.lexsort((angle, key[sides]))
    first, second = _candidates(key[sides])
    first, second = order[first], order[second]
    one, two = sides[first], sides[second]
    differ = forward[one] == forward[two]
    apart = sheet[one // 3] != sheet[two // 3]
    # a side that runs forward has the inside on the side of smaller angles, the other one on that of larger ones
    inside = np.where(forward[one], angle[first] - angle[second], angle[second] - angle[first]) % (2 * np.pi)
    # 0 where they go on straight, 1 where one lies on the other; of two equal bends the convex one, so that bodies that
    # touch along an edge stay two
    cost = np.abs(np.pi - inside) / np.pi + 1e-6 * inside + apart + 2.0 * differ
    best = np.argsort(cost, kind="stable")
    return _chosen(np.stack([one, two], axis=1)[best], differ[best], sheet)


def _angles(
    V: NDArray[np.float64], F: NDArray[np.int64], sides: NDArray[np.int64], key: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Angles at which triangles lie round their common edge, counted from the first on it, seen against the edge.

    Sides are sorted by `key`, the number of their edge.
    """
    triangle, k = sides // 3, sides % 3
    a, b = F[triangle, k], F[triangle, (k + 1) % 3]
    axis = V[np.maximum(a, b)] - V[np.minimum(a, b)]
    axis = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), np.finfo(float).tiny)
    across = V[F[triangle, (k + 2) % 3]] - V[a]
    across = across - np.einsum("ij,ij->i", across, axis)[:, None] * axis
    begins = np.append(True, key[1:] != key[:-1])
    first = across[np.flatnonzero(begins)[np.cumsum(begins) - 1]]
    turn = np.einsum("ij,ij->i", np.cross(first, across), axis)
    return np.arctan2(turn, np.einsum("ij,ij->i", first, across)) % (2 * np.pi)


def _candidates(key: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of places in a sorted list that have the same key: all, or, of very many, neighbours in turn."""
    starts = np.flatnonzero(np.append(True, key[1:] != key[:-1]))
    sizes = np.diff(np.append(starts, len(key)))
    first, second = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for size in np.unique(sizes[sizes > 1]).tolist():
        pairs = (
            itertools.combinations(range(size), 2) if size <= _ALL_PAIRS else ((i, (i + 1) % size) for i in range(size))
        )
        i, j = np.array(list(pairs)).T
        base = starts[sizes == size][:, None]
        first.append((base + i).ravel())
        second.append((base + j).ravel())
    return np.concatenate(first), np.concatenate(second)


def _chosen(pairs: NDArray[np.int64], against: NDArray[np.bool_], sheet: NDArray[np.int64]) -> NDArray[np.int64]:
    """The pairs taken one after the other, as long as their sides are free and windings can still be made to agree."""
    parent = list(range(int(sheet.max()) + 1))
    odd = [False] * len(parent)  # turned against the parent
    size = [1] * len(parent)

    def root(node: int) -> tuple[int, bool]:
        flip = False
        while parent[node] != node:
            flip ^= odd[node]
            node = parent[node]
        return node, flip

    taken: set[int] = set()
    chosen = []
    sheets = sheet[pairs // 3].tolist()
    for (first, second), (one, two), differ in zip(pairs.tolist(), sheets, against.tolist(), strict=True):
        if first in taken or second in taken:
            continue
        (a, flip_a), (b, flip_b) = root(one), root(two)
        turn = differ ^ flip_a ^ flip_b
        if a == b and turn:
            continue
        if a != b:
            small, large = (a, b) if size[a] < size[b] else (b, a)
            parent[small], odd[small] = large, turn
            size[large] += size[small]
        taken |= {first, second}
        chosen.append((first, second))
    return np.array(chosen, dtype=np.int64).reshape(-1, 2)
